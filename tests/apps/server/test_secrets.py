"""Keys and tokens are in no answer, log, event or error, however a turn goes."""

import os
import re
import signal
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import httpx
import pytest
from formup.apps.server.tokens import Tokens

from .conftest import PHOTOS

KEY = "sk-secret-of-a-provider-0123456789"


@pytest.mark.skipif(sys.platform == "win32", reason="ended by a signal")
def test_no_secret_leaves_the_process(tmp_path: Path) -> None:
    file = tmp_path / "tokens.json"
    token = Tokens(file).add("ann", "move")
    store = f"sqlite:///{tmp_path}/s.db"
    command = [sys.executable, "-W", "ignore", "-m", "formup", "serve", "--port", "0"]
    command += ["--store", store, "--tokens", str(file), "--model", "openai:gpt-x"]
    command += ["--base-url", "http://127.0.0.1:9/v1"]
    environment = os.environ | {"OPENAI_API_KEY": KEY}
    seen: list[str] = []
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stderr is not None
        while not (found := re.search(r"http://\S+:\d+", "".join(seen))):
            seen.append(process.stderr.readline())
        log = process.stderr
        draining = threading.Thread(target=lambda: seen.extend(log))
        draining.start()
        by = {"Authorization": f"Bearer {token}"}
        with httpx.Client(base_url=found[0], headers=by, timeout=60, trust_env=False) as client:
            photo = (PHOTOS / "us_coins.jpg").read_bytes()
            made = client.post("/api/sessions", params={"robots": 4}, content=photo)
            session = f"/api/sessions/{made.json()['id']}"
            said = client.post(f"{session}/messages", json={"words": "Cage the largest coin"})
            assert said.json()["status"] == "failed", "the model cannot be reached"
            for path in (session, f"{session}/turns/2", "/api/agents", "/metrics", "/nowhere"):
                seen.append(client.get(path).text)
            seen += [made.text, said.text]
            seen.append(client.get(f"/api/sessions?token={token}").text)
            wrong = client.get("/api/agents", headers={"Authorization": f"Bearer {token}x"})
            seen.append(wrong.text)
        process.send_signal(signal.SIGTERM)
        draining.join(20)
    with sqlite3.connect(tmp_path / "s.db") as database:
        seen += [row[0] for row in database.execute("SELECT data FROM formup_events")]
    database.close()
    assert any('"event": "request"' in text for text in seen)
    assert any('"turn"' in text for text in seen)
    for text in seen:
        assert KEY not in text
        assert token not in text
