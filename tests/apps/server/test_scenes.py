import io
import zipfile
from pathlib import Path
from typing import Any

import pytest
from formup.apps.server.tokens import Tokens
from PIL import Image

from .conftest import Running, Serve

COIN = {"id": "t1", "box": [175, 28, 316, 162]}


def robots_of(found: Any) -> dict[str, tuple[float, float]]:
    return {robot["id"]: (robot["x"], robot["y"]) for robot in found["robots"]}


@pytest.fixture
def session(server: Running) -> str:
    session = server.begin()
    server.say(session, "Surround it, 20 px from it", pointed=[COIN])
    return session


def test_a_scene_is_there_before_anything_was_said(server: Running) -> None:
    session = server.begin()
    scene = server.client.get(f"{session}/scene").json()
    assert (scene["picture"]["width"], scene["picture"]["height"]) == (568, 439)
    assert scene["plan"] is None and scene["plans"] == []
    picture = server.client.get(f"{session}/picture")
    assert Image.open(io.BytesIO(picture.content)).size == (568, 439)
    assert len(server.client.get(f"{session}/things").json()) > 5


def test_a_scene_has_the_plan_as_it_is(server: Running, session: str) -> None:
    report = server.client.get(session).json()["last"]
    plan = server.client.get(f"{session}/scene").json()["plan"]
    assert plan["id"] == report["plan_id"] and plan["certified"]
    pairs: Any = zip(report["robots"], report["positions"], strict=True)
    assert robots_of(plan) == {name: (x, y) for name, (x, y) in pairs}
    assert plan["groups"][0]["nearest_px"] == pytest.approx(20, abs=1.1)
    assert plan["worst"]["robot"] in report["robots"]
    assert len(plan["areas"]) == 1
    missing = server.client.get(f"{session}/scene", params={"plan": "p-0"})
    assert missing.status_code == 404


def test_pointing_shows_an_outline_and_decides_nothing(server: Running) -> None:
    session = server.begin()
    found = server.client.post(f"{session}/outline", json={"prompt": COIN}).json()
    assert found["sound"] and found["confidence"] > 0.8
    outside = {"prompt": {"points": [[900, 10]]}}
    refused = server.client.post(f"{session}/outline", json=outside)
    assert refused.status_code == 422
    assert "outside the picture" in refused.json()["error"]["message"]
    assert server.client.get(f"{session}/scene").json()["targets"] == []


def test_what_is_tried_is_what_an_edit_makes_and_changes_nothing(
    server: Running, session: str
) -> None:
    before = server.client.get(session).json()["current"]
    x, y = robots_of(server.client.get(f"{session}/scene").json()["plan"])["3"]
    for edit in (
        {"kind": "distance", "px": 30},
        {"kind": "count", "robots": 11},
        {"kind": "place", "robot": 3, "to": [x + 4, y + 20], "stays": "near"},
    ):
        tried = server.client.post(f"{session}/preview", json={"edits": [edit]}).json()
        assert tried["certified"], tried["findings"]
        assert server.client.get(session).json()["current"] == before
        made = server.client.post(f"{session}/edits", json={"edits": [edit]})
        assert made.json()["status"] == "planned"
        plan = server.client.get(f"{session}/scene").json()["plan"]
        assert sorted(robots_of(plan).values()) == sorted(robots_of(tried).values())
        server.client.post(f"{session}/undo", json={"steps": 1})
        before = server.client.get(session).json()["current"]


def test_a_robot_that_stays_in_its_group_is_held_to_its_demands(
    server: Running, session: str
) -> None:
    x, y = robots_of(server.client.get(f"{session}/scene").json()["plan"])["3"]
    far = {"kind": "place", "robot": 3, "to": [x, y + 80]}
    there = server.client.post(
        f"{session}/preview", json={"edits": [far | {"stays": "there"}]}
    ).json()
    assert not there["certified"]
    assert [r["wrong"] for r in there["robots"] if r["id"] == "3"] == [True]
    near = server.client.post(
        f"{session}/preview", json={"edits": [far | {"stays": "near"}]}
    ).json()
    assert not any("px from t1" in sentence for sentence in near["findings"])
    alone = server.client.post(f"{session}/preview", json={"edits": [far]}).json()
    assert alone["certified"] and any("by itself" in note for note in alone["notes"])
    nobody = far | {"robot": 99}
    refused = server.client.post(f"{session}/preview", json={"edits": [nobody]})
    assert refused.status_code == 422 and "no robot 99" in refused.json()["error"]["message"]


def test_a_session_leaves_as_a_file(server: Running, session: str) -> None:
    sent = server.client.get(f"{session}/export")
    made = zipfile.ZipFile(io.BytesIO(sent.content))
    assert {"session.md", "session.json"} <= set(made.namelist())
    assert "Surround it" in made.read("session.md").decode()


def test_a_shared_link_looks_at_one_session_and_does_nothing(serve: Serve, tmp_path: Path) -> None:
    tokens = Tokens(tmp_path / "tokens.json")
    ann = {"Authorization": f"Bearer {tokens.add('ann', 'move')}"}
    server = serve(tokens=tmp_path / "tokens.json")
    session, other = server.begin(headers=ann), server.begin(headers=ann)
    said = {"words": "Cage the largest coin"}
    server.client.post(f"{session}/messages", headers=ann, json=said)
    code = server.client.post(f"{session}/shares", headers=ann).json()["code"]
    link = {"Authorization": f"Share {code}"}
    for path in ("", "/scene", "/picture", "/export"):
        assert server.client.get(f"{session}{path}", headers=link).status_code == 200
    for method, path in (
        ("GET", f"{other}/scene"),
        ("GET", "/api/sessions"),
        ("GET", f"{session}x"),
        ("POST", f"{session}/messages"),
        ("POST", f"{session}/stop"),
        ("POST", f"{session}/shares"),
        ("DELETE", session),
        ("GET", "/v1/models"),
        ("GET", "/metrics"),
    ):
        assert server.client.request(method, path, headers=link).status_code == 403, path
    forged = {"Authorization": f"Share {code[:-1]}{'0' if code[-1] != '0' else '1'}"}
    moved = {"Authorization": f"Share {other.rpartition('/')[2]}.{code.rpartition('.')[2]}"}
    for wrong in (forged, moved):
        assert server.client.get(f"{session}/scene", headers=wrong).status_code == 401
    tokens.remove("ann")
    assert server.client.get(f"{session}/scene", headers=link).status_code == 401


def test_reports_are_pages_of_their_own(serve: Serve, tmp_path: Path) -> None:
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports/a b.html").write_text("<p>fine</p>")
    (tmp_path / "reports/notes.txt").write_text("no")
    tokens = Tokens(tmp_path / "tokens.json")
    ann = {"Authorization": f"Bearer {tokens.add('ann', 'read')}"}
    server = serve(tokens=tmp_path / "tokens.json", reports=tmp_path / "reports")
    assert server.client.get("/api/reports").status_code == 401
    (listed,) = server.client.get("/api/reports", headers=ann).json()
    assert listed["name"] == "a b.html"
    shown = server.client.get(listed["address"])
    assert shown.text == "<p>fine</p>"
    assert shown.headers["Content-Security-Policy"].startswith("sandbox allow-scripts;")
    for wrong in (listed["address"][:-6] + ".html", listed["address"].replace("ann", "bob")):
        assert server.client.get(wrong).status_code == 404
