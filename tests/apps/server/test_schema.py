# pyright: basic, reportAttributeAccessIssue=false, reportArgumentType=false
# schemathesis leaves its types open
from pathlib import Path

import schemathesis
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.folder_store import FolderStore
from formup.apps.server.app import make_app
from formup.apps.server.settings import ServerSettings
from formup.apps.server.tokens import Tokens
from formup.tools.context import Settings
from formup.tools.perception.image import load_picture
from hypothesis import HealthCheck, given, settings
from hypothesis.strategies import booleans
from schemathesis.specs.openapi.checks import (
    ensure_resource_availability,
    positive_data_acceptance,
    use_after_free,
)

from .conftest import PHOTOS

EXCLUDED = [
    ensure_resource_availability,  # across links it raises false alarms (schemathesis#2983)
    use_after_free,  # the same
    positive_data_acceptance,  # no schema says whether bytes are a picture, or words an answer
]
STREAMS = r"/events$"
"""Left out: they do not end by themselves."""


def test_the_server_is_as_its_document_says(tmp_path: Path) -> None:
    fixed = ServerSettings(hosts="testserver", requests_per_minute=10**6, sessions=10**6)
    service = Service(Agent(), FolderStore(tmp_path))
    there = service.open(load_picture(PHOTOS / "us_coins.jpg"), settings=Settings(robots=4))
    app = make_app(service, fixed, Tokens(None))
    schema = schemathesis.openapi.from_asgi("/openapi.json", app).exclude(path_regex=STREAMS)
    operations = [found.ok() for found in schema.get_all_operations()]
    assert len(operations) > 15
    for operation in operations:

        @given(case=operation.as_strategy(), real=booleans())
        @settings(max_examples=25, deadline=None, suppress_health_check=[*HealthCheck])
        def check(case: schemathesis.Case, real: bool) -> None:
            if real and "session" in case.path_parameters and case.method != "DELETE":
                case.path_parameters["session"] = there
            case.call_and_validate(excluded_checks=EXCLUDED)

        check()
