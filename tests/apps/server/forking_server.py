"""Servers one after another, each in a process of its own that starts without importing anew.

Each line on standard input starts one, at the port that it names, if it names one; its process id
and port are printed as a line.
"""

import asyncio
import os
import sys
from collections.abc import AsyncGenerator

import uvicorn
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.places import store_at
from formup.apps.server.app import make_app
from formup.apps.server.run import Server
from formup.apps.server.settings import ServerSettings
from formup.apps.server.tokens import Tokens
from formup.tools.fleet.protocol import Motion, Pose
from formup.tools.fleet.simulated import SimulatedFleet

drive = SimulatedFleet.drive


async def slow(self: SimulatedFleet, motion: Motion) -> AsyncGenerator[tuple[Pose, ...], None]:
    async for poses in drive(self, motion):
        yield poses
        await asyncio.sleep(0.02)


def serve(store: str, port: int) -> None:
    SimulatedFleet.drive = slow  # type: ignore[method-assign]
    fixed = ServerSettings(requests_per_minute=10**6)
    app = make_app(Service(Agent(), store_at(store)), fixed, Tokens(None))
    config = uvicorn.Config(
        app, port=port, lifespan="on", log_config=None, timeout_graceful_shutdown=2
    )
    server = Server(config, app.state.hub)

    async def work() -> None:
        serving = asyncio.create_task(server.serve())
        while not server.started:
            await asyncio.sleep(0.005)
        port = server.servers[0].sockets[0].getsockname()[1]
        sys.stdout.write(f"{os.getpid()} {port}\n")
        sys.stdout.flush()
        await serving

    asyncio.run(work())


for line in sys.stdin:
    if not os.fork():
        serve(sys.argv[1], int(line.strip() or 0))
        os._exit(0)
