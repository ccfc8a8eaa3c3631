import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from formup.agent.session import load_run
from formup.agent.store.places import store_at
from formup.agent.store.protocol import Event

PHOTO = Path(__file__).parents[3] / "evals/photos/images/us_coins.jpg"
JSON = {"Content-Type": "application/json"}
KILLS = 40
pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
Start = Callable[..., tuple[int, httpx.Client]]


@pytest.fixture
def start(tmp_path: Path) -> Generator[Start]:
    """Starts another server on the same store; its process id, and a client of it."""
    script = Path(__file__).parent / "forking_server.py"
    command = [sys.executable, "-W", "ignore", script, f"sqlite:///{tmp_path}/s.db"]
    pids, clients = list[int](), list[httpx.Client]()
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as forking:
        assert forking.stdin is not None and forking.stdout is not None

        def begin(at: str = "") -> tuple[int, httpx.Client]:
            assert forking.stdin is not None and forking.stdout is not None
            forking.stdin.write(f"{at}\n")
            forking.stdin.flush()
            pid, port = map(int, forking.stdout.readline().split())
            pids.append(pid)
            client = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60, trust_env=False)
            clients.append(client)
            return pid, client

        yield begin
        for client in clients:
            client.close()
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        forking.stdin.close()


def begun(client: httpx.Client) -> str:
    made = client.post("/api/sessions", params={"robots": 8}, content=PHOTO.read_bytes())
    session = f"/api/sessions/{made.json()['id']}"
    said = client.post(f"{session}/messages", json={"words": "Cage the largest coin"})
    assert said.json()["status"] == "planned"
    return session


def request_of(round: int, session: str, client: httpx.Client) -> dict[str, Any]:
    """A deployment, or a turn, under a key of its own."""
    headers = {"Idempotency-Key": f"k{round}"}
    if round % 2:
        plan = client.get(session).json()["current"]
        deployment = {"url": f"{session}/deployments", "json": {"plan_id": plan}}
        return {**deployment, "headers": headers}
    said = {"url": f"{session}/messages", "json": {"words": "a bit further out"}}
    return {**said, "headers": headers}


def killed(pid: int, client: httpx.Client, request: dict[str, Any], after: float) -> None:
    """Send a request and kill the server so many seconds later."""

    def ask() -> None:
        with suppress(httpx.HTTPError):
            client.post(**request)

    asking = threading.Thread(target=ask)
    asking.start()
    time.sleep(after)
    os.kill(pid, signal.SIGKILL)
    asking.join(20)


def moves(events: Sequence[Event]) -> int:
    return len([event for event in events if event.kind == "moving"])


def test_kills_in_the_middle_of_turns_and_deployments(start: Start, tmp_path: Path) -> None:
    dice, store = random.Random(4), store_at(f"sqlite:///{tmp_path}/s.db")
    pid, client = start()
    session, interrupted = begun(client), 0
    name = session.rpartition("/")[2]
    for round in range(KILLS):
        request = request_of(round, session, client)
        killed(pid, client, request, dice.uniform(0.0, 0.5))
        pid, client = start()
        load_run(store.open(name))  # the session is whole
        events = store.open(name).events()
        keyed = [e for e in events if e.data.get("key") == f"k{round}"]
        assert len(keyed) <= 1
        for event in keyed:
            state = client.get(f"{session}/turns/{event.number}").json()
            ended = next((e for e in events[event.number :] if e.kind == "end"), None)
            assert state["status"] == ("interrupted" if ended is None else ended.data["status"])
            interrupted += ended is None
        again = client.post(**request)
        assert again.status_code in (200, 202), again.text
        if keyed:
            assert again.json()["turn"] == keyed[0].number, "it is not done again"
            assert moves(store.open(name).events()) == moves(events), "no robot moves twice"
        else:
            number = again.json()["turn"]
            done = client.get(f"{session}/turns/{number}", params={"wait": 30}).json()
            assert done["status"] in ("deployed", "planned", "impossible", "answered")
        if round % 5 == 4:  # start over, before there is no more room
            assert client.post(f"{session}/undo", json={"to": "first"}).status_code == 200
    assert interrupted > KILLS // 10, "some kills came in the middle"


def test_two_processes_share_a_session(start: Start) -> None:
    (_, here), (_, there) = start(), start()
    session = begun(here)
    further = there.post(f"{session}/messages", json={"words": "a bit further out"}).json()
    assert further["status"] == "planned"
    go = here.post(f"{session}/messages", json={"words": "go"})
    assert (go.status_code, go.json()["moving"]) == (202, True)
    refused = there.post(f"{session}/messages", json={"words": "closer"})
    assert (refused.status_code, refused.json()["error"]["code"]) == (409, "busy")
    assert ":" in refused.json()["error"]["message"], "it says which process"
    number = go.json()["turn"]
    assert there.get(f"{session}/turns/{number}").json()["status"] == "running"
    held = there.post(f"{session}/stop").json()
    assert held["status"] == "answered"
    ended = here.get(f"{session}/turns/{number}", params={"wait": 30}).json()
    assert ended["status"] in ("stopped", "failed")


def test_sigterm_holds_robots_and_ends_streams(start: Start) -> None:
    pid, client = start()
    session = begun(client)
    host = str(client.base_url)
    ends: list[str] = []

    def follow() -> None:
        with httpx.stream("GET", f"{host}{session}/events", timeout=30, trust_env=False) as told:
            ends.append("".join(told.iter_text())[-2:])

    readers = [threading.Thread(target=follow) for _ in range(10)]
    for reader in readers:
        reader.start()
    while client.get("/metrics").text.count("formup_event_streams 10.0") == 0:
        time.sleep(0.02)
    go = client.post(f"{session}/messages", json={"words": "go"}).json()
    assert go["moving"]
    os.kill(pid, signal.SIGTERM)
    for reader in readers:
        reader.join(10)
    assert ends == ["\n\n"] * 10, "every stream ended after a whole event"
    _, again = start()
    state = again.get(f"{session}/turns/{go['turn']}").json()
    assert state["status"] in ("stopped", "failed"), "the turn is whole"
