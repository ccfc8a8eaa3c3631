import json
import socket
import time
from pathlib import Path
from typing import Any

import pytest
from formup.apps.server.settings import ServerSettings
from formup.apps.server.tokens import Tokens
from formup.tools.errors import InputError
from formup.tools.fleet.simulated import SimulatedFleet
from PIL import Image
from pydantic_core import to_json

from .conftest import JPEG, PHOTOS, Running, Serve


def test_a_whole_conversation(server: Running) -> None:
    session = server.begin()
    planned = server.say(session, "Cage the largest coin")
    assert planned["status"] == "planned"
    assert planned["report"]["verdict"]["certified"]
    further = server.say(session, "a bit further out")
    assert further["report"]["parent"] == planned["report"]["plan_id"]
    asked = server.say(session, "how far is robot 4?")
    assert asked["status"] == "answered"
    edits = {"edits": [{"kind": "count", "robots": 6}]}
    edited = server.client.post(f"{session}/edits", json=edits)
    assert edited.status_code == 200, edited.text
    undone = server.client.post(f"{session}/undo", json={"steps": 2}).json()
    assert undone["report"]["plan_id"] == planned["report"]["plan_id"]
    state = server.client.get(session).json()
    assert state["current"] == planned["report"]["plan_id"]
    job = server.client.post(
        f"{session}/deployments",
        json={"plan_id": state["current"]},
        headers={"Idempotency-Key": "first"},
    )
    assert job.status_code == 202
    done = server.client.get(f"{session}/turns/{job.json()['turn']}", params={"wait": 30}).json()
    assert done["status"] == "deployed"
    assert done["report"]["arrival"]["arrived"]
    picture = server.client.get(f"{session}/plans/{state['current']}/picture")
    assert picture.headers["content-type"] == "image/png"
    plan = server.client.get(f"{session}/plans/{state['current']}").json()
    assert plan["plan"]["verdict"]["certified"]
    assert not plan["void"]
    track = server.client.get(f"{session}/artefacts/{done['report']['arrival']['track']}")
    assert len(json.loads(track.content)["robots"]) == 8


def test_a_clock_that_is_set_back_changes_nothing(
    server: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = server.begin()
    first = server.say(session, "Cage the largest coin")
    clock = time.time
    monkeypatch.setattr(time, "time", lambda: clock() - 3600)
    monkeypatch.setattr("formup.agent.store.database.now", lambda: "2000-01-01T00:00:00.000+00:00")
    other = server.begin()
    second = server.say(session, "a bit further out")
    assert second["report"]["parent"] == first["report"]["plan_id"]
    told = server.say(session, "go")
    done = server.client.get(f"{session}/turns/{told['turn']}", params={"wait": 30}).json()
    assert done["status"] == "deployed"
    listed = [facts["id"] for facts in server.client.get("/api/sessions").json()]
    assert sorted(listed) == sorted(path.rpartition("/")[2] for path in (session, other))


def test_sessions_are_listed_renamed_forked_and_deleted(server: Running) -> None:
    session = server.begin()
    first = server.say(session, "Cage the largest coin")
    server.say(session, "twice as far")
    fork = server.client.post(f"{session}/forks", json={"turn": 1}).json()

    assert fork["current"] == first["report"]["plan_id"]
    server.client.patch(session, json={"name": "coins"})
    listed = server.client.get("/api/sessions", params={"text": "coins"}).json()
    assert [s["id"] for s in listed] == [session.rpartition("/")[2]]
    assert len(server.client.get("/api/sessions").json()) == 2
    assert server.client.delete(session).status_code == 204
    assert server.client.get(session).status_code == 404


def test_a_session_that_another_process_deleted_is_nowhere(server: Running) -> None:
    paths = server.client.get("/openapi.json").json()["paths"]
    own = [(method, path) for path, at in paths.items() if "{session}" in path for method in at]
    photo = (PHOTOS / "us_coins.jpg").read_bytes()
    bodies: dict[str, Any] = {
        "messages": {"words": "further out"},
        "edits": {"edits": [{"kind": "count", "robots": 6}]},
        "approvals": {"plan_id": "p-1", "nonce": "n"},
        "deployments": {"plan_id": "p-1"},
        "outline": {"prompt": {"points": [[240, 90]]}},
        "preview": {"edits": [{"kind": "count", "robots": 6}]},
        "{session}": {"name": "coins"},
    }
    for method, path in own:
        session = server.begin()
        turn = server.say(session, "Cage the largest coin")
        name = session.rpartition("/")[2]
        server.service.store.delete(name)
        plan = turn["report"]["plan_id"]
        address = path.format(
            session=name, plan_id=plan, number=turn["turn"], sha256="0" * 64, turn=1
        )
        body = to_json(bodies.get(path.rpartition("/")[2], {})) if method != "put" else photo
        headers = {"Idempotency-Key": "k", "Content-Type": "application/json"}
        told = server.client.request(method, address, headers=headers, content=body)
        assert told.status_code == 404, (method, path, told.text)


def test_a_deployment_is_done_once_for_its_key(server: Running) -> None:
    session = server.begin()
    plan = server.say(session, "Cage the largest coin")["report"]["plan_id"]
    key = {"Idempotency-Key": "k"}

    def deploy(plan_id: str, **headers: str) -> Any:
        return server.client.post(
            f"{session}/deployments", json={"plan_id": plan_id}, headers=headers
        )

    assert deploy(plan).status_code == 422, "a deployment needs a key"
    first = deploy(plan, **key).json()
    server.client.get(f"{session}/turns/{first['turn']}", params={"wait": 30})
    again = deploy(plan, **key)
    assert again.status_code == 202
    assert (again.json()["turn"], again.json()["status"]) == (first["turn"], "deployed")
    other = deploy("p-other", **key)
    assert (other.status_code, other.json()["error"]["code"]) == (409, "key")
    events = server.service.events(session.rpartition("/")[2])
    assert len([e for e in events if e.kind == "moving"]) == 1


def test_another_picture_and_a_point_that_answers(server: Running) -> None:
    session = server.begin("cars_two.jpg", robots=4)
    asked = server.say(session, "Surround the car")
    assert asked["status"] == "question"
    point = {"id": "t1", "points": [[390, 260]]}
    planned = server.say(session, "this one", pointed=[point])
    assert planned["status"] == "planned", planned["message"]
    other = (PHOTOS / "us_coins.jpg").read_bytes()
    changed = server.client.put(f"{session}/picture", content=other, headers=JPEG)
    assert changed.json()["status"] == "answered"
    plan = server.client.get(f"{session}/plans/{planned['report']['plan_id']}").json()
    assert plan["void"]


@pytest.mark.parametrize(
    ("method", "path", "what", "status"),
    [
        ("GET", "/api/sessions/none", {}, 404),
        ("GET", "{session}/plans/p-0", {}, 404),
        ("GET", "{session}/turns/1", {}, 404),
        ("GET", "{session}/artefacts/{zeros}", {}, 404),
        ("POST", "/api/sessions", {"content": b"no picture"}, 422),
        ("POST", "/api/sessions", {"content": b""}, 422),
        ("POST", "/api/sessions?agent=nobody", {"content": b"picture"}, 404),
        ("POST", "/api/sessions?robots=0", {"content": b"picture"}, 422),
        ("POST", "{session}/messages", {"json": {"words": ""}}, 422),
        ("POST", "{session}/messages", {"json": {"words": "x" * 30_000}}, 422),
        ("POST", "{session}/messages", {"json": {"words": "go", "moves": True}}, 422),
        ("POST", "{session}/messages", {"content": b"{"}, 422),
        ("POST", "{session}/undo", {"json": {}}, 422),
        ("POST", "{session}/edits", {"content": b'{"edits":[{"a":"\\ud800"}]}'}, 422),
        (
            "POST",
            "{session}/deployments",
            {"json": {"plan_id": "p-0"}, "headers": {"Idempotency-Key": "k"}},
            404,
        ),
        ("POST", "{session}/approvals", {"json": {"plan_id": "p", "nonce": "n"}}, 409),
        ("GET", "{session}/events", {"headers": {"Last-Event-ID": "x"}}, 422),
        ("PATCH", "{session}", {"json": {"name": "x" * 300}}, 422),
        ("GET", "/nowhere", {}, 404),
        ("PUT", "/api/agents", {}, 405),
    ],
)
def test_what_cannot_be_done_is_told_in_a_sentence(
    server: Running, method: str, path: str, what: dict[str, Any], status: int
) -> None:
    session = server.begin("us_coins.jpg")
    if "content=b'picture'" in str(what) or what.get("content") == b"picture":
        what = {"content": (PHOTOS / "us_coins.jpg").read_bytes()}
    path = path.format(session=session, zeros="0" * 64)
    response = server.client.request(method, path, **what)
    assert response.status_code == status, response.text
    error = response.json()["error"]
    assert error["message"]
    assert "Traceback" not in response.text
    assert "s.db" not in response.text, "clients are not told where sessions are kept"
    assert server.client.get(session).json()["last"] is None, "nothing was done"


@pytest.fixture
def tokens(tmp_path: Path) -> tuple[Path, dict[str, str]]:
    """A file of tokens, and them by name; each is named after its scope."""
    file = tmp_path / "tokens.json"
    made = Tokens(file)
    return file, {scope: made.add(scope, scope) for scope in ("read", "plan", "move")}


def test_tokens_keep_sessions_apart_and_scopes_hold(
    serve: Serve, tokens: tuple[Path, dict[str, str]]
) -> None:
    file, made = tokens
    server = serve(tokens=file)
    by = {name: {"Authorization": f"Bearer {token}"} for name, token in made.items()}
    assert server.client.get("/api/sessions").status_code == 401
    wrong = server.client.get("/api/sessions", headers={"Authorization": "Bearer fu_wrong"})
    assert wrong.status_code == 401
    assert wrong.headers["www-authenticate"] == "Bearer"
    assert server.client.get("/health/live").status_code == 200
    session = server.begin(headers=by["plan"])
    said = {"words": "Cage the largest coin"}
    planned = server.client.post(f"{session}/messages", json=said, headers=by["plan"]).json()
    plan = planned["report"]["plan_id"]
    for other in ("read", "move"):
        for path in ("", "/events", f"/plans/{plan}", "/turns/2"):
            assert server.client.get(session + path, headers=by[other]).status_code == 404
    go = server.client.post(f"{session}/messages", json={"words": "go"}, headers=by["plan"])
    assert (go.status_code, go.json()["error"]["code"]) == (403, "not_allowed")
    deploy = server.client.post(
        f"{session}/deployments",
        json={"plan_id": plan},
        headers=by["plan"] | {"Idempotency-Key": "1"},
    )
    assert deploy.status_code == 403
    assert server.client.post("/api/sessions", headers=by["read"]).status_code == 403
    assert server.client.post(f"{session}/stop", headers=by["plan"]).status_code == 200
    text = file.read_text()
    assert not any(token in text for token in made.values()), "tokens are hashed at rest"
    Tokens(file).remove("plan")
    assert server.client.get(session, headers=by["plan"]).status_code == 401


def test_who_approves_sees_what_waits_and_says_yes(
    serve: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SimulatedFleet, "real", True)
    made = Tokens(file := tmp_path / "tokens.json")
    ann, eve, boss = (
        {"Authorization": f"Bearer {made.add(name, scope)}"}
        for name, scope in (("ann", "move"), ("eve", "move"), ("boss", "approve"))
    )
    server = serve(tokens=file)
    session, other = (server.begin(headers=ann) for _ in range(2))
    said = {"words": "Cage the largest coin"}
    turn = server.client.post(f"{session}/messages", json=said, headers=ann).json()
    assert server.client.get(session, headers=boss).status_code == 404, "nothing waits yet"
    plan = turn["report"]["plan_id"]
    key, wanted = ann | {"Idempotency-Key": "1"}, {"plan_id": plan}
    began = server.client.post(f"{session}/deployments", json=wanted, headers=key)
    asked = began.json()["turn"]
    told = server.client.get(f"{session}/turns/{asked}?wait=30", headers=ann).json()
    assert told["status"] == "needs_approval"

    listed = server.client.get("/api/sessions", headers=boss).json()
    assert [facts["id"] for facts in listed] == [session.rpartition("/")[2]]
    waits = server.client.get(session, headers=boss).json()["waits"]
    assert server.client.get(f"{session}/plans/{plan}/picture", headers=boss).status_code == 200
    yes = {"plan_id": plan, "nonce": waits["nonce"]}
    for who in (eve, boss):
        for method, path in (("GET", "/events"), ("POST", "/stop"), ("GET", f"/turns/{asked}")):
            assert server.client.request(method, session + path, headers=who).status_code == 404
        assert server.client.post(f"{session}/messages", json=said, headers=who).status_code == 404
        assert server.client.get(other, headers=who).status_code == 404
    assert server.client.post(f"{session}/approvals", json=yes, headers=eve).status_code == 404
    given = server.client.post(f"{session}/approvals", json=yes, headers=boss)
    assert given.status_code == 202
    done = f"{session}/turns/{given.json()['turn']}?wait=30"
    told = server.client.get(done, headers=boss).json()
    assert (told["status"], told["by"]) == ("deployed", "boss")
    assert server.client.get(done, headers=ann).json()["status"] == "deployed"
    assert server.client.get(session, headers=boss).status_code == 404, "nothing waits any more"
    assert server.client.get("/api/sessions", headers=boss).json() == []


def test_what_others_may_not_send(serve: Serve) -> None:
    server = serve(upload_bytes=200_000, pixels=100_000, body_seconds=1, sessions=1)
    for headers in ({"Host": "evil.example"}, {"Host": "127.0.0.1.evil.example"}):
        assert server.client.get("/api/sessions", headers=headers).status_code == 421
    assert server.client.get("/api/sessions", headers={"Host": "["}).status_code == 421
    for headers in (
        {"Origin": "http://["},
        {"Origin": "http://evil.example"},
        {"Sec-Fetch-Site": "cross-site"},
    ):
        assert server.client.post("/api/sessions", headers=headers).status_code == 403
    same = {"Origin": server.url}
    assert server.client.post("/api/sessions", headers=same).status_code == 422
    large = server.client.post("/api/sessions", content=b"x" * 300_000)
    assert large.status_code == 413
    chunks = server.client.post("/api/sessions", content=iter([b"x" * 100_000] * 3))
    assert chunks.status_code == 413, "without a declared length too"
    parts = iter([b'{"words": "', b"x" * 300_000])
    json_kind = {"Content-Type": "application/json"}
    said = server.client.post("/api/sessions/x/messages", content=parts, headers=json_kind)
    assert said.status_code == 413, "as JSON too"
    photo = PHOTOS / "us_coins.jpg"
    with Image.open(photo) as header:
        assert header.width * header.height > 100_000
    pixels = server.client.post("/api/sessions", content=photo.read_bytes()[:190_000])
    assert (pixels.status_code, pixels.json()["error"]["code"]) == (413, "too_large")


def test_a_client_that_sends_nothing_is_let_go_of(serve: Serve) -> None:
    server = serve(body_seconds=0.3)
    host, port = server.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=20) as slow:
        head = "POST /api/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 100\r\n\r\n"
        slow.sendall(head.encode() + b"x")
        assert b"408" in slow.recv(1000).split(b"\r\n")[0]


def test_sessions_and_requests_have_bounds(serve: Serve) -> None:
    server = serve(sessions=1, requests_per_minute=6)
    server.begin()
    full = server.client.post("/api/sessions", content=b"x")
    assert (full.status_code, full.json()["error"]["code"]) == (429, "too_many")
    for _ in range(4):
        assert server.client.get("/api/sessions").status_code == 200
    assert server.client.get("/api/sessions").status_code == 429
    assert server.client.get("/health/live").status_code == 200


def test_figures_and_health(server: Running) -> None:
    session = server.begin()
    server.say(session, "Cage the largest coin")
    text = server.client.get("/metrics").text
    assert 'formup_turns_total{status="planned"} 1.0' in text
    assert "coin" not in text, "words are not counted"
    assert server.client.get("/health/ready").json() == {"status": "ok"}


def test_settings_come_from_the_environment() -> None:
    made = ServerSettings.of({"FORMUP_PORT": "80", "FORMUP_HOST": "::1"}, port=81)
    assert (made.host, made.port) == ("::1", 81)
    with pytest.raises(InputError, match="FORMUP_PORT is 'x'"):
        ServerSettings.of({"FORMUP_PORT": "x"})


def test_new_sessions_see_as_the_settings_say(serve: Serve) -> None:
    server = serve(threshold=1.0)
    coin = {"pointed": [{"box": [175, 30, 314, 160]}]}
    refused = server.say(server.begin(), "Cage it", **coin)
    assert refused["report"]["positions"] is None
    assert "below the threshold 1.00" in json.dumps(refused)
    told = {"FORMUP_SEGMENTER": "sam", "FORMUP_DETECTOR": "standout+groundingdino"}
    settings = ServerSettings.of(told | {"FORMUP_THRESHOLD": ".3"}, segmenter="langsam")
    chosen = settings.of_session(robots=3)
    assert (chosen.detector, chosen.segmenter) == ("standout+groundingdino", "langsam")
    assert (chosen.threshold, chosen.robots) == (0.3, 3)
