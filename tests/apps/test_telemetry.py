"""Spans sent as OpenTelemetry's environment variables say, to a receiver of OTLP over HTTP."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.agent.wrappers.telemetry import environment_tracer
from formup.tools.errors import InputError
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from PIL import Image

PIXELS = np.full((140, 200, 3), 60, np.uint8)
PIXELS[40:90, 60:120] = (200, 40, 40)
RUN = ("run", "scene.png", "Surround the red thing", "-n", "6", "--json", "--out", "out")


@pytest.fixture
def no_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in os.environ:
        if name.startswith("OTEL_"):
            monkeypatch.delenv(name)


@pytest.mark.parametrize(
    "variables",
    [
        {},
        {"OTEL_EXPORTER_OTLP_ENDPOINT": ""},
        {"OTEL_TRACES_EXPORTER": "none", "OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:1"},
        {"OTEL_SDK_DISABLED": "True", "OTEL_TRACES_EXPORTER": "otlp"},
    ],
)
@pytest.mark.usefixtures("no_variables")
def test_no_tracer_where_none_is_asked_for(
    variables: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    with environment_tracer() as tracer:
        assert tracer is None


@pytest.mark.usefixtures("no_variables")
def test_an_exporter_there_is_not_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OTEL_TRACES_EXPORTER", "zipkin")
    with (
        pytest.raises(InputError, match="zipkin is not known here; otlp, console and none"),
        environment_tracer(),
    ):
        pass


@pytest.mark.usefixtures("no_variables")
@pytest.mark.parametrize("module", ["sdk.trace", "exporter.otlp.proto.http.trace_exporter"])
def test_the_extra_missing_is_one_sentence(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OTEL_TRACES_EXPORTER", "otlp")
    monkeypatch.setitem(sys.modules, f"opentelemetry.{module}", None)
    with pytest.raises(InputError) as raised, environment_tracer():
        pass
    assert str(raised.value) == "OpenTelemetry is not installed; pip install 'formup[otel]'."


class Receiver(BaseHTTPRequestHandler):
    """Takes what OTLP over HTTP brings."""

    bodies: list[bytes]
    paths: list[str]

    def do_POST(self) -> None:
        self.paths.append(self.path)
        self.bodies.append(self.rfile.read(int(self.headers["content-length"])))
        self.send_response(200)
        self.send_header("content-length", "0")
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@pytest.fixture
def receiver() -> Iterator[tuple[str, type[Receiver]]]:
    kept = type("Kept", (Receiver,), {"bodies": [], "paths": []})
    with ThreadingHTTPServer(("127.0.0.1", 0), kept) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,)).start()
        yield f"http://127.0.0.1:{server.server_address[1]}", kept
        server.shutdown()


Formup = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def formup(tmp_path: Path) -> Formup:
    Image.fromarray(PIXELS).save(tmp_path / "scene.png")
    kept = {name: value for name, value in os.environ.items() if not name.startswith("OTEL_")}
    whole = [sys.executable, "-m", "formup"]

    def start(
        *arguments: str, variables: Mapping[str, str], command: list[str] = whole
    ) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*command, *arguments],
            cwd=tmp_path,
            env=kept | {"NO_PROXY": "127.0.0.1"} | dict(variables),
            capture_output=True,
            text=True,
            check=False,
        )

    return start


def received(kept: type[Receiver]) -> list[tuple[str, list[str]]]:
    """(service, names of its spans) of every message."""
    found: list[tuple[str, list[str]]] = []
    for body in kept.bodies:
        for whole in ExportTraceServiceRequest.FromString(body).resource_spans:
            resource = {a.key: a.value.string_value for a in whole.resource.attributes}
            names = [span.name for scope in whole.scope_spans for span in scope.spans]
            found.append((resource["service.name"], names))
    return found


def test_the_command_line_sends_what_a_collector_reads(
    receiver: tuple[str, type[Receiver]], formup: Formup
) -> None:
    url, kept = receiver
    secrets = {"OPENAI_API_KEY": "sk-secret", "OTEL_EXPORTER_OTLP_HEADERS": "x-key=sk-secret"}
    at = {"OTEL_EXPORTER_OTLP_ENDPOINT": url} | secrets
    done = formup(*RUN, variables=at)
    assert (done.returncode, json.loads(done.stdout)["status"]) == (0, "deployed"), done.stderr
    ((service, names),) = received(kept)
    assert (service, kept.paths) == ("formup", ["/v1/traces"])
    assert names[0] == "chat offline"
    assert names[-1] == "invoke_agent formup"
    assert "execute_tool deploy" in names
    assert not any(b"red thing" in body or b"sk-secret" in body for body in kept.bodies)


def test_a_resumed_run_is_sent_too_under_the_name_the_environment_gives(
    receiver: tuple[str, type[Receiver]], formup: Formup
) -> None:
    url, kept = receiver
    stopped = formup(*RUN, "--limit", "requests=1", variables={})
    assert (stopped.returncode, kept.bodies) == (4, []), stopped.stderr
    at = {"OTEL_EXPORTER_OTLP_TRACES_ENDPOINT": f"{url}/spans", "OTEL_SERVICE_NAME": "robots"}
    resume = ("resume", "out", "--json", "--limit", "requests=20")
    done = formup(*resume, variables=at)
    assert done.returncode == 0, done.stderr
    ((service, names),) = received(kept)
    assert (service, kept.paths) == ("robots", ["/spans"])
    assert names[-1] == "invoke_agent formup"


def test_the_console_is_the_standard_error(formup: Formup) -> None:
    done = formup(*RUN, variables={"OTEL_TRACES_EXPORTER": "console"})
    assert json.loads(done.stdout)["status"] == "deployed"
    assert '"name": "invoke_agent formup"' in done.stderr


def test_a_run_goes_on_without_the_extra(formup: Formup) -> None:
    code = (
        "import sys; sys.modules['opentelemetry'] = None; from formup.apps.main import main; main()"
    )
    at = {"OTEL_EXPORTER_OTLP_ENDPOINT": "http://127.0.0.1:1"}
    done = formup(*RUN, variables=at, command=[sys.executable, "-c", code])
    assert (done.returncode, json.loads(done.stdout)["status"]) == (0, "deployed"), done.stderr
    assert done.stderr.splitlines() == [
        "formup: no spans are sent: OpenTelemetry is not installed; pip install 'formup[otel]'.",
        "formup: files in out",
    ]
