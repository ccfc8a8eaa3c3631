import json
import socket
import threading
from pathlib import Path
from typing import Any

import pytest
from formup.apps.server.tokens import Tokens
from formup.tools.fleet.pace import pace_of

from .conftest import Running, Serve

Frame = tuple[str | None, dict[str, Any]]


def read(server: Running, session: str, last: str | None, until: str, cut: int = 10**9) -> str:
    """What a stream brings up to the end of the frame with an id, or to so many bytes."""
    headers = {} if last is None else {"Last-Event-ID": last}
    text = b""
    with server.client.stream("GET", f"{session}/events", headers=headers) as response:
        assert response.status_code == 200
        assert response.headers["content-type"].startswith("text/event-stream")
        for part in response.iter_raw():
            text += part
            if len(text) >= cut or f"id: {until}\n\n".encode() in text:
                break
    return text[:cut].decode(errors="ignore")


def frames(text: str) -> list[Frame]:
    """The frames that came whole."""
    found: list[Frame] = []
    for block in text.split("\n\n")[:-1]:
        fields = dict(line.split(": ", 1) for line in block.splitlines() if ": " in line)
        if "data" in fields:
            data = json.loads(fields["data"])
            assert fields["event"] == data["type"]
            found.append((fields.get("id"), data))
    return found


@pytest.fixture
def spoken(server: Running) -> tuple[Running, str, list[Frame], str]:
    """A session with all frames of its stream, and the stream itself."""
    session = server.begin()
    server.say(session, "Cage the largest coin")
    server.say(session, "how far is robot 4?")
    last = server.service.events(session.rpartition("/")[2])[-1].number
    text = read(server, session, None, f"{last}.0")
    return server, session, frames(text), text


def test_a_stream_tells_a_conversation_as_ag_ui_does(
    spoken: tuple[Running, str, list[Frame], str],
) -> None:
    _, session, all_frames, _ = spoken
    kinds = [data["type"] for _, data in all_frames]
    assert kinds.count("RUN_STARTED") == kinds.count("RUN_FINISHED") == 2
    for kind in ("TEXT_MESSAGE", "TOOL_CALL"):
        assert kinds.count(f"{kind}_START") == kinds.count(f"{kind}_END")
    calls = {d["toolCallId"] for _, d in all_frames if d["type"] == "TOOL_CALL_START"}
    results = {d["toolCallId"] for _, d in all_frames if d["type"] == "TOOL_CALL_RESULT"}
    assert calls == results
    runs = [d["runId"] for _, d in all_frames if d["type"].startswith("RUN_")]
    assert runs[0::2] == runs[1::2]
    assert {d["threadId"] for _, d in all_frames if "threadId" in d} == {session.rpartition("/")[2]}


def test_a_stream_cut_at_every_byte_resumes_without_loss(
    spoken: tuple[Running, str, list[Frame], str],
) -> None:
    server, session, all_frames, text = spoken
    final = all_frames[-1][0]
    assert final is not None
    resumed: dict[str | None, list[Frame]] = {}
    for cut in range(len(text)):
        before = frames(text[:cut])
        last = before[-1][0] if before else None
        if last == final:
            break
        if last not in resumed:  # whatever is cut within a frame resumes alike
            resumed[last] = frames(read(server, session, last, final))
        assert before + resumed[last] == all_frames, f"cut at byte {cut}"
    assert len(resumed) >= len(all_frames) - 1


def test_a_slow_reader_holds_up_nobody(server: Running) -> None:
    session = server.begin()
    host, port = server.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=20) as slow:
        slow.sendall(f"GET {session}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        for words in ("Cage the largest coin", "further out", "closer", "go"):
            turn = server.say(session, words)["turn"]
        done = server.client.get(f"{session}/turns/{turn}", params={"wait": 30}).json()
        assert done["status"] == "deployed"


def test_who_follows_sees_poses_and_the_end(server: Running) -> None:
    session = server.begin(robots=30)
    server.say(session, "Cage the largest coin")
    found: list[Frame] = []

    def follow() -> None:
        text = ""
        with server.client.stream("GET", f"{session}/events") as response:
            for part in response.iter_text():
                text += part
                if '"status": "deployed"' in text or '"status":"deployed"' in text:
                    break
        found.extend(frames(text))

    reader = threading.Thread(target=follow)
    reader.start()
    server.say(session, "go")
    reader.join(30)
    assert not reader.is_alive()
    poses = [d["value"] for _, d in found if d.get("name") == "poses"]
    assert all(i is None for i, d in found if d.get("name") == "poses"), "they are not resumed"
    if poses:  # the latest alone are told, perhaps none before the end
        assert {p["id"] for p in poses[-1]["poses"]} >= {str(n) for n in range(1, 31)}
    assert any(d.get("name") == "moving" for _, d in found)


def test_a_stream_ends_with_its_token(serve: Serve, tmp_path: Path) -> None:
    tokens = Tokens(tmp_path / "tokens.json")
    ann, bob = ({"Authorization": f"Bearer {tokens.add(name, 'plan')}"} for name in ("ann", "bob"))
    server = serve(tokens=tmp_path / "tokens.json")
    streams = [
        server.client.stream("GET", f"{server.begin(headers=who)}/events", headers=who)
        for who in (ann, bob)
    ]
    with streams[0] as gone, streams[1] as stays:
        tokens.remove("ann")
        for _ in gone.iter_raw():
            pass  # to its end, which is a whole one
        assert server.client.get("/metrics", headers=bob).text.count("formup_event_streams 1.0")
        assert next(stays.iter_raw())


def test_simulated_robots_drive_in_real_time_only_while_somebody_watches(server: Running) -> None:
    session = server.begin()
    plan = server.say(session, "Surround the largest coin")["report"]["plan_id"]
    held = server.service.session(session.rpartition("/")[2])
    assert held.services is not None
    headers = {"Idempotency-Key": "one"}
    with server.client.stream("GET", f"{session}/events?watching=true") as response:
        lines = response.iter_lines()
        next(lines)
        deployment = {"plan_id": plan}
        server.client.post(f"{session}/deployments", headers=headers, json=deployment)
        assert any('"name": "poses"' in line for line in lines)
        (fleet,) = held.services.fleets.values()
        pace = pace_of(fleet)
        assert pace is not None and pace.speed == 1.0
        assert any('"RUN_FINISHED"' in line for line in lines)
    assert pace.speed is None
