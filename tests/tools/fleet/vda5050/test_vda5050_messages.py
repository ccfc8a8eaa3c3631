"""The schemas are the official ones; what goes out names no field that they do not."""

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
from formup.tools.fleet.vda5050.messages import Writer, action, mistake, read
from formup.tools.fleet.vda5050.settings import Vda5050Settings
from formup.tools.fleet.vda5050.spec import DIALECTS

VENDOR = Path(__file__).parents[4] / "vendor/vda5050"
SETTINGS = {
    version: Vda5050Settings.model_validate(
        {
            "version": version,
            "broker": "mqtt://h",
            "interface": "uagv",
            "manufacturer": "KIT",
            "map": "m",
            "robots": ["a"],
            "speed": 1,
            "radius": 1,
            "tracking_error": 1,
        }
    )
    for version in DIALECTS
}


@pytest.mark.parametrize("version", DIALECTS)
def test_the_schemas_are_as_they_were_fetched(version: str) -> None:
    lines = (VENDOR / version / "SHA256SUMS").read_text().splitlines()
    listed = {name: digest for digest, name in (line.split() for line in lines)}
    found = {
        p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in (VENDOR / version).iterdir()
    }
    found.pop("SHA256SUMS")
    assert found == listed
    assert {"order.schema", "state.schema", "LICENSE.txt"} <= set(found)


@pytest.mark.parametrize("version", DIALECTS)
def test_no_message_goes_out_that_has_a_mistyped_field(version: Any) -> None:
    writer = Writer(SETTINGS[version])
    good = {"actions": [action("cancelOrder", "1")]}
    sent = writer.message("a", "instantActions", good)
    assert (sent["headerId"], sent["serialNumber"]) == (0, "a")
    assert writer.message("a", "instantActions", good)["headerId"] == 1
    for wrong in (
        {"actions": [action("cancelOrder", "1") | {"actionTyp": "x"}]},
        {**good, "acts": []},
        {"actions": [action("cancelOrder", "1") | {"blockingType": "SOMETIMES"}]},
        {},
    ):
        with pytest.raises(RuntimeError, match="instantActions is not valid: "):
            writer.message("a", "instantActions", wrong)
    typo: dict[str, Any] = {**sent, "acts": []}
    assert mistake(version, "instantActions", typo)
    assert read(version, "instantActions", json.dumps(typo).encode()) == typo


@pytest.mark.parametrize("version", DIALECTS)
@pytest.mark.parametrize(
    "payload",
    [b"", b"\xff", b"[]", b"7", b'{"headerId": NaN}', b"[" * 50_000, b'{"headerId": "1"}'],
)
def test_what_is_no_message_is_not_read(version: Any, payload: bytes) -> None:
    for kind in ("state", "visualization", "connection", "order", "instantActions"):
        assert read(version, kind, payload) is None
