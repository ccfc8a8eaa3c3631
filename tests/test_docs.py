"""What the README and the docs show is run, so that it stays true."""

import json
import os
import re
import shlex
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.apps.demo import RUNS
from PIL import Image

ROOT = Path(__file__).parent.parent
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]


def blocks(language: str) -> list[tuple[str, str]]:
    return [
        (page.name, block)
        for page in PAGES
        for block in re.findall(rf"```{language}\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    ]


ELSEWHERE = {
    "fleets.md": "tests/tools/fleet/mqtt/test_fleets_page.py",
    "own-fleet.md": "tests/test_own_pages.py",
    "own-segmenter.md": "tests/test_own_pages.py",
    "own-suite.md": "tests/test_own_pages.py",
    "prompts.md": "tests/apps/test_prompts.py",
    "ros.md": "tests/tools/fleet/ros/test_ros_page.py",
    "serving.md": "tests/apps/server/test_docs.py",
    "warehouse.md": "tests/tools/fleet/vda5050/test_warehouse_page.py",
}
"""Pages whose commands other tests run: servers do not end, or files are to be written first."""
PYTHON_ELSEWHERE = {
    "cluster.md": "tests/servers/test_ray.py",
    "own-fleet.md": "tests/test_own_pages.py",
    "own-segmenter.md": "tests/test_own_pages.py",
}
"""Pages whose Python other tests run: it stands in files, or needs an extra that tests lack."""


def commands_of(block: str) -> list[tuple[str, list[str]]]:
    """The commands of a block, each with the lines that the page shows of its output."""
    found = list[tuple[str, list[str]]]()
    for line in block.replace("\\\n", " ").splitlines():
        if line.startswith("$ "):
            found.append((line.removeprefix("$ "), []))
        elif found and line.strip() not in ("", "..."):
            found[-1][1].append(line)
    return [(command, shown) for command, shown in found if command.startswith("formup")]


COMMANDS = {
    page: [
        command
        for name, block in blocks("console")
        if name == page
        for command in commands_of(block)
    ]
    for page, _ in blocks("console")
    if page not in ELSEWHERE
}
"""Commands by the page they stand on: a later one may go on where an earlier one ended."""
ASKING = ("question:", "impossible:", "needs_approval:")
"""How the line begins that says why a run has moved nothing, of which the exit code is 3."""


def plain(text: str) -> str:
    """Output without line breaks and without what another processor may compute otherwise."""
    return re.sub(r"\bp-[0-9a-f]+|[0-9]+(\.[0-9]+)?", "#", " ".join(text.split()))


SHOWN = {
    "formup calibrate": "written     camera.yaml",
    "formup run": "deployed:",
    "formup resume": "deployed:",
    "formup eval suites": "zerocap15",
    "formup eval run": "chance GCR",
    "formup eval table": "Table I of the paper",
    "formup prompts": "former",
    "formup chat": "deployed:",
    "formup sessions": "6 turns",
}
"""What commands print of which the page shows nothing, by how they begin."""
OWN: dict[str, dict[str, Any]] = {"wind": {}, "battery": {"robot": "1"}}
"""Arguments for the tools of pages, by name."""
BOXES = {"lighter": [314, 313, 361, 461]}
"""Where things are that are not where the test's own picture has its box, by what is asked for."""


class Provider(BaseHTTPRequestHandler):
    """A server in the provider's place that proposes, deploys and says so, and tries every tool
    that is not formup's own first."""

    def do_POST(self) -> None:
        request = json.loads(self.rfile.read(int(self.headers["content-length"])))
        results = [m["content"] for m in request["messages"] if m["role"] == "tool"]
        names = [t["function"]["name"] for t in request["tools"]]
        calls = [(name, OWN[name]) for name in names if name in OWN]
        group = {"relation": "around", "targets": ["t1"], "robots": 6}
        named = (box for word, box in BOXES.items() if word in str(request["messages"]))
        target = {"id": "t1", "box": next(named, [55, 35, 125, 95])}
        calls.append(("propose_formation", {"contract": {"groups": [group]}, "targets": [target]}))
        plans = re.findall("p-[0-9a-f]+", str(results))
        calls += [("deploy", {"plan_id": plan}) for plan in plans[:1]]
        message: dict[str, object] = {"role": "assistant", "content": "They stand there."}
        if len(results) < len(calls):
            name, arguments = calls[len(results)]
            function = {"name": name, "arguments": json.dumps(arguments)}
            message |= {"tool_calls": [{"id": "x", "type": "function", "function": function}]}
        body = json.dumps({"choices": [{"message": message, "finish_reason": "stop"}]}).encode()
        self.send_response(200)
        self.send_header("content-length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing."""


@pytest.fixture(scope="module")
def provider() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Provider) as server:
        threading.Thread(target=server.serve_forever, args=(0.01,)).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/v1"
        server.shutdown()


@pytest.mark.parametrize(
    ("page", "code"), [block for block in blocks("python") if block[0] not in PYTHON_ELSEWHERE]
)
def test_python_blocks_run(page: str, code: str, provider: str, tmp_path: Path) -> None:
    for folder in ("evals", "docs", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    pixels = np.full((140, 200, 3), 60, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    Image.fromarray(pixels).save(tmp_path / "photo.jpg", quality=95)
    command = [sys.executable, "-W", "error", "-c", code]
    environment = os.environ | {"OPENAI_BASE_URL": provider}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert {"motion.md": "[100. 100.]"}.get(page, "deployed") in done.stdout


@pytest.mark.parametrize("page", COMMANDS)
def test_commands_run_as_written(page: str, provider: str, tmp_path: Path) -> None:
    for folder in ("evals", "docs", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    home = os.environ | {"XDG_DATA_HOME": str(tmp_path), "OPENAI_BASE_URL": provider}
    for command, shown in COMMANDS[page]:
        arguments = [sys.executable, "-m", *shlex.split(command)]
        done = subprocess.run(
            arguments, cwd=tmp_path, env=home, capture_output=True, text=True, check=False
        )
        code = 3 if any(line.startswith(ASKING) for line in shown) else 0
        assert done.returncode == code, f"{command}: {done.stdout}{done.stderr}"
        known = (text for start, text in SHOWN.items() if command.startswith(start))
        for line in shown or [next(known, '"settled": true')]:
            assert plain(line) in plain(done.stdout), command


def test_there_is_something_to_run() -> None:
    assert sum(map(len, COMMANDS.values())) >= 3
    assert blocks("python")


@pytest.mark.parametrize(
    ("script", "page"), [("talk.txt", "chat.md"), ("table.txt", "tutorial.md")]
)
def test_the_script_that_is_run_is_the_one_shown(script: str, page: str) -> None:
    said = (ROOT / "docs" / script).read_text("utf-8")
    assert f"\n```\n{said}```\n" in (ROOT / "docs" / page).read_text("utf-8")


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", page.read_text("utf-8")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_make_demo_points_at_the_things_it_names() -> None:
    assert "formup demo" in (ROOT / "Makefile").read_text("utf-8")
    pictures = {picture.name: picture for picture, _ in RUNS.values()}
    assert {"cars_two.jpg", "ucm_sparseresidential28.jpg", "us_coins.jpg"} < set(pictures)
    assert all(picture.is_file() for picture in pictures.values())
