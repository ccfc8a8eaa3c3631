"""What a server adds to the turns it serves: the same conversations over HTTP and in process.

`python -m formup.benchmarks.bench_server`: 200 conversations at once, each planned and edited, by
the offline planner on a photograph, in a SQLite store; CPU of the serving process alone. Then its
memory after many turns, and how many follow one deployment.
"""

import asyncio
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

import httpx

from ..agent.agent import Agent
from ..agent.service import Service
from ..agent.store.places import store_at
from ..tools.context import Settings
from ..tools.perception.image import load_picture

PHOTO = Path(__file__).parents[1] / "evals/photos/images/us_coins.jpg"
WORDS = ("Cage the largest coin", "a bit further out", "turn it 10 degrees", "how far is robot 4?")
SESSIONS, TURNS, SUBSCRIBERS = 200, (1_000, 10_000), 1_000
Say = Callable[[str, str], Awaitable[None]]


async def _talks(begin: Callable[[], Awaitable[str]], say: Say) -> tuple[list[float], float]:
    """Seconds of each first turn, and of all, for many conversations at once."""

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


@asynccontextmanager
async def _server(store: str) -> AsyncGenerator[httpx.AsyncClient]:
    """A server in a process of its own, and a client of it."""
    environment = os.environ | {
        "FORMUP_REQUESTS_PER_MINUTE": "1000000",
        "FORMUP_REQUESTS": "5000",
        "FORMUP_SESSIONS": "100000",
    }
    command = [sys.executable, "-m", "formup", "serve", "--port", "0", "--store", store]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stderr is not None
        while not (found := re.search(r"http://\S+:\d+", process.stderr.readline())):
            pass
        drain = asyncio.get_running_loop().run_in_executor(None, process.stderr.read)
        limits = httpx.Limits(max_connections=None, keepalive_expiry=2)
        try:
            async with httpx.AsyncClient(
                base_url=found[0].rstrip(";"), timeout=600, limits=limits, trust_env=False
            ) as client:
                yield client
        finally:
            process.terminate()
            await drain


async def _figure(client: httpx.AsyncClient, name: str) -> float:
    found = re.search(rf"^{name} (\S+)$", (await client.get("/metrics")).text, re.M)
    assert found is not None
    return float(found[1])


async def _begin(client: httpx.AsyncClient, data: bytes) -> str:
    made = await client.post("/api/sessions", params={"robots": 8}, content=data)
    return made.raise_for_status().json()["id"]


async def _say(client: httpx.AsyncClient, session: str, words: str) -> None:
    said = await client.post(
        f"/api/sessions/{session}/messages", params={"wait": 60}, json={"words": words}
    )
    said.raise_for_status()


async def _over_http(store: str) -> tuple[list[float], float, float]:
    data = PHOTO.read_bytes()
    async with _server(store) as client:
        cpu = await _figure(client, "process_cpu_seconds_total")

        async def say(session: str, words: str) -> None:
            await _say(client, session, words)

        firsts, wall = await _talks(lambda: _begin(client, data), say)
        spent = await _figure(client, "process_cpu_seconds_total") - cpu
        planned = await _figure(client, 'formup_turns_total{status="planned"}')
        assert planned == 3 * SESSIONS, f"{planned:g} planned of {3 * SESSIONS}: some were lost"
    return firsts, wall, spent


def _row(name: str, firsts: Sequence[float], wall: float, spent: float) -> str:
    cuts, turns = quantiles(firsts, n=100), SESSIONS * len(WORDS)
    times = f"first turn p50 {cuts[49]:6.2f} s, p99 {cuts[98]:6.2f} s"
    return f"  {name:<10} {turns / wall:6.1f} turns/s, {times}, {1000 * spent / turns:6.1f} ms CPU"


async def _memory(store: str) -> None:
    data, done = PHOTO.read_bytes(), 0
    async with _server(store) as client:
        for until in TURNS:
            while done < until:
                session = await _begin(client, data)
                for words in WORDS:
                    await _say(client, session, words)
                done += len(WORDS)
            held = await _figure(client, "process_resident_memory_bytes")
            print(f"  {until:>6} turns: {held / 2**20:6.1f} MiB", flush=True)  # noqa: T201


async def _followers(store: str) -> None:
    """Many follow one deployment; each has to hear its end."""
    async with _server(store) as client:
        session = await _begin(client, PHOTO.read_bytes())
        await _say(client, session, WORDS[0])

        async def follow() -> float:
            path = f"/api/sessions/{session}/events"
            async with client.stream("GET", path) as told:
                async for line in told.aiter_lines():
                    if '"status": "deployed"' in line or '"status":"deployed"' in line:
                        return time.perf_counter()
            raise AssertionError("a stream ended before the deployment did")

        following = [asyncio.create_task(follow()) for _ in range(SUBSCRIBERS)]
        while await _figure(client, "formup_event_streams") < SUBSCRIBERS:
            await asyncio.sleep(0.2)
        began = time.perf_counter()
        await _say(client, session, "go")
        ends = [end - began for end in await asyncio.gather(*following)]
        print(  # noqa: T201
            f"  {SUBSCRIBERS} subscribers heard of the end of one deployment, the last after "
            f"{max(ends):.1f} s"
        )


def main() -> None:
    """Print what a server adds."""
    with TemporaryDirectory() as folder:
        stores = [f"sqlite:///{folder}/{name}.db" for name in "abcd"]
        rows = {
            "in process": asyncio.run(_in_process(stores[0])),
            "over HTTP": asyncio.run(_over_http(stores[1])),
        }
        print(f"{SESSIONS} conversations of {len(WORDS)} turns at once")  # noqa: T201
        for name, row in rows.items():
            print(_row(name, *row))  # noqa: T201
        ratio = rows["over HTTP"][2] / rows["in process"][2]
        print(f"  CPU of the server to that of the bare service: {ratio:.2f}")  # noqa: T201
        asyncio.run(_followers(stores[2]))
        if "--memory" in sys.argv:
            print("memory of the server, conversations one after another")  # noqa: T201
            asyncio.run(_memory(stores[3]))


if __name__ == "__main__":
    main()
