"""`python -m formup.benchmarks.bench_server`: what a server adds to the turns it serves.

It holds 200 conversations at once over HTTP and in process: the offline planner, a photograph, a
SQLite store, CPU of the serving process alone. Then many clients follow one deployment. With
--memory instead, it prints the memory of the process over many turns.
"""

import asyncio
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import AsyncGenerator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from statistics import quantiles
from tempfile import TemporaryDirectory

from ..agent.agent import Agent
from ..agent.service import Service
from ..agent.store.places import store_at
from ..tools.context import Settings
from ..tools.perception.image import load_picture
from .growth import show

PHOTO = Path(__file__).parents[1] / "evals/photos/images/us_coins.jpg"
WORDS = ("Cage the largest coin", "a bit further out", "turn it 10 degrees", "how far is robot 4?")
COIN = {"id": "t1", "outline": [[246, 32], [311, 97], [246, 156], [181, 95]]}
"""Outline of the coin, pointed at so that turns are quick, as nothing has to be found."""
CHEAP = ("how far is robot 4?", "undo", "how many robots are there?", "redo")
SESSIONS, TURNS, SUBSCRIBERS = 200, 10_000, 1_000
LINE = 2**24
"""Most bytes of a line of an event stream."""
Say = Callable[[str, str], Awaitable[None]]


async def _talks(begin: Callable[[], Awaitable[str]], say: Say) -> tuple[list[float], float]:
    """Hold many conversations at once; return seconds of each first turn, and of all together."""

    async def talk() -> float:
        session = await begin()
        before = time.perf_counter()
        await say(session, WORDS[0])
        first = time.perf_counter() - before
        for words in WORDS[1:]:
            await say(session, words)
        return first

    began = time.perf_counter()
    firsts = await asyncio.gather(*(talk() for _ in range(SESSIONS)))
    return firsts, time.perf_counter() - began


async def _in_process(store: str) -> tuple[list[float], float, float]:
    picture, service = load_picture(PHOTO), Service(Agent(), store_at(store))

    async def begin() -> str:
        return service.open(picture, settings=Settings(robots=8))

    async def say(session: str, words: str) -> None:
        await service.say(session, words)

    cpu = time.process_time()
    firsts, wall = await _talks(begin, say)
    spent = time.process_time() - cpu
    await service.close()
    return firsts, wall, spent


class Client:
    """A client of a server, with one connection per request.

    Args:
        address: HOST:PORT.
    """

    def __init__(self, address: str) -> None:
        self._host, _, self._port = address.partition(":")

    @asynccontextmanager
    async def opened(
        self, method: str, path: str, body: bytes = b""
    ) -> AsyncGenerator[asyncio.StreamReader]:
        """Yield the response to a request as a stream."""
        reader, writer = await asyncio.open_connection(self._host, int(self._port), limit=LINE)
        kind = "application/json" if body[:1] == b"{" else "image/jpeg"
        head = f"{method} {path} HTTP/1.1\r\nHost: {self._host}\r\nConnection: close\r\n"
        head += f"Content-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n"
        writer.write(head.encode() + body)
        await writer.drain()
        yield reader
        writer.close()

    async def asked(self, method: str, path: str, body: bytes = b"") -> str:
        """Return the whole response to a request, head included."""
        async with self.opened(method, path, body) as reader:
            text = (await reader.read()).decode()
        assert text.startswith("HTTP/1.1 2"), text[:500]
        return text

    async def begin(self, data: bytes, path: str = "/api/sessions?robots=8") -> str:
        """Begin a session with a picture, or by posting to another path; return its path."""
        made = await self.asked("POST", path, data)
        return f"/api/sessions/{json.loads(made[made.index('{') :])['id']}"

    async def say(self, session: str, words: str, **more: object) -> None:
        """Say something and wait for the turn to end."""
        said = json.dumps({"words": words, **more}).encode()
        told = await self.asked("POST", f"{session}/messages?wait=60", said)
        while told.startswith("HTTP/1.1 202"):
            number = json.loads(told[told.index("{") :])["turn"]
            told = await self.asked("GET", f"{session}/turns/{number}?wait=60")

    async def figure(self, name: str) -> float:
        """Return one of the server's metrics."""
        found = re.search(rf"^{name} (\S+)$", await self.asked("GET", "/metrics"), re.M)
        assert found is not None
        return float(found[1])


@asynccontextmanager
async def _server(store: str) -> AsyncGenerator[Client]:
    """Yield a client of a server in a process of its own."""
    environment = os.environ | {
        "FORMUP_REQUESTS_PER_MINUTE": "1000000",
        "FORMUP_REQUESTS": "5000",
        "FORMUP_SESSIONS": "100000",
    }
    command = [sys.executable, "-m", "formup", "serve", "--port", "0", "--store", store]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stderr is not None
        while not (found := re.search(r"http://(\S+:\d+)", process.stderr.readline())):
            pass
        drain = asyncio.get_running_loop().run_in_executor(None, process.stderr.read)
        try:
            yield Client(found[1])
        finally:
            process.terminate()
            await drain


async def _over_http(store: str) -> tuple[list[float], float, float]:
    data = PHOTO.read_bytes()
    async with _server(store) as client:
        cpu = await client.figure("process_cpu_seconds_total")
        firsts, wall = await _talks(lambda: client.begin(data), client.say)
        spent = await client.figure("process_cpu_seconds_total") - cpu
        planned = await client.figure('formup_turns_total{status="planned"}')
        assert planned == 3 * SESSIONS, f"{planned:g} planned of {3 * SESSIONS}: some were lost"
    return firsts, wall, spent


def _row(name: str, firsts: Sequence[float], wall: float, spent: float) -> str:
    cuts, turns = quantiles(firsts, n=100), SESSIONS * len(WORDS)
    times = f"first turn p50 {cuts[49]:6.2f} s, p99 {cuts[98]:6.2f} s"
    return f"  {name:<10} {turns / wall:6.1f} turns/s, {times}, {1000 * spent / turns:6.1f} ms CPU"


async def _memory(store: str) -> None:
    """Print memory over short conversations; each is a fork, so that planning costs no time."""
    async with _server(store) as client:
        planned = await client.begin(PHOTO.read_bytes())
        await client.say(planned, "Surround it", pointed=[COIN])
        await client.say(planned, "a bit further out")
        for done in range(0, TURNS, len(CHEAP)):
            fork = await client.begin(b"{}", f"{planned}/forks")
            for words in CHEAP:
                await client.say(fork, words)
            if (turns := done + len(CHEAP)) % (TURNS // 10) == 0:
                held = await client.figure("process_resident_memory_bytes")
                show([f"  {turns:>6} turns: {held / 2**20:6.1f} MiB"])


async def _followers(store: str) -> None:
    """Print how soon all of many followers of one deployment receive its end."""
    async with _server(store) as client:
        session = await client.begin(PHOTO.read_bytes())
        await client.say(session, WORDS[0])

        async def follow() -> float:
            async with client.opened("GET", f"{session}/events") as reader:
                while line := await reader.readline():
                    if b"RUN_FINISHED" in line and b'"deployed"' in line:
                        return time.perf_counter()
            raise AssertionError("a stream ended before the deployment did")

        following = [asyncio.create_task(follow()) for _ in range(SUBSCRIBERS)]
        while await client.figure("formup_event_streams") < SUBSCRIBERS:
            await asyncio.sleep(0.2)
        began = time.perf_counter()
        await client.say(session, "go")
        last = max(await asyncio.gather(*following)) - began
        show(
            [f"  {SUBSCRIBERS} followed one deployment; the last heard its end after {last:.1f} s"]
        )


def main() -> None:
    """Print what a server adds; with --memory, how much memory it uses after many turns."""
    with TemporaryDirectory() as folder:
        stores = [f"sqlite:///{folder}/{name}.db" for name in "abc"]
        if "--memory" in sys.argv:
            show(["memory of the server, conversations one after another"])
            asyncio.run(_memory(stores[0]))
            return
        rows = {
            "in process": asyncio.run(_in_process(stores[0])),
            "over HTTP": asyncio.run(_over_http(stores[1])),
        }
        ratio = rows["over HTTP"][2] / rows["in process"][2]
        show(
            [
                f"{SESSIONS} conversations of {len(WORDS)} turns at once",
                *(_row(name, *row) for name, row in rows.items()),
                f"  CPU of the server to that of the bare service: {ratio:.2f}",
            ]
        )
        asyncio.run(_followers(stores[2]))


if __name__ == "__main__":
    main()
