import asyncio
import threading
from collections.abc import Callable, Generator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn
from formup.agent.agent import Agent
from formup.agent.service import Service
from formup.agent.store.places import store_at
from formup.apps.server.app import make_app
from formup.apps.server.run import Server
from formup.apps.server.settings import ServerSettings
from formup.apps.server.tokens import Tokens

PHOTOS = Path(__file__).parents[3] / "evals/photos/images"
JPEG = {"Content-Type": "image/jpeg"}


@dataclass
class Running:
    """A server in a thread, on loopback."""

    url: str
    service: Service
    client: httpx.Client

    def begin(self, photo: str = "us_coins.jpg", robots: int = 8, headers: Any = None) -> str:
        """A session about a photograph; the path of its routes."""
        data = (PHOTOS / photo).read_bytes()
        made = self.client.post(
            "/api/sessions", content=data, params={"robots": robots}, headers=JPEG | (headers or {})
        )
        assert made.status_code == 201, made.text
        return f"/api/sessions/{made.json()['id']}"

    def say(self, session: str, words: str, **more: Any) -> Any:
        """A turn that is waited for."""
        said = self.client.post(f"{session}/messages", json={"words": words, **more})
        assert said.status_code in (200, 202), said.text
        return said.json()


Serve = Callable[..., Running]


@pytest.fixture
def serve(tmp_path: Path) -> Generator[Serve]:
    """Starts servers, which share a store."""
    with ExitStack() as stack:

        def start(agents: Any = None, tokens: Path | None = None, **settings: Any) -> Running:
            fixed = ServerSettings(port=0, tokens_file=tokens, **settings)
            begun, loops = threading.Event(), list[Any]()

            async def work() -> None:
                service = Service(agents or Agent(), store_at(f"sqlite:///{tmp_path}/s.db"))
                app = make_app(service, fixed, Tokens(tokens))
                config = uvicorn.Config(
                    app, port=0, lifespan="on", ws="none", log_config=None, access_log=False
                )
                server = Server(config, app.state.hub)
                loops.extend([asyncio.get_running_loop(), server, service])
                serving = asyncio.create_task(server.serve())
                while not server.started and not serving.done():
                    await asyncio.sleep(0.01)
                begun.set()
                await serving

            thread = threading.Thread(target=lambda: asyncio.run(work()))
            thread.start()
            begun.wait(20)
            server, service = loops[1:]
            port = server.servers[0].sockets[0].getsockname()[1]
            url = f"http://127.0.0.1:{port}"
            client = stack.enter_context(httpx.Client(base_url=url, timeout=60, trust_env=False))

            def end() -> None:
                server.should_exit = True
                thread.join(20)
                assert not thread.is_alive()

            stack.callback(end)
            return Running(url, service, client)

        yield start


@pytest.fixture
def server(serve: Serve) -> Running:
    return serve()
