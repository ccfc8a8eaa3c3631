import re
import shutil
import subprocess
from pathlib import Path

import pytest
from formup.apps.server.settings import PREFIX, ServerSettings

from .conftest import Running

ROOT = Path(__file__).parents[3]


def part(page: str, name: str) -> str:
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    found = re.search(rf"<!-- {name} -->\n(.*)<!-- /{name} -->", text, re.S)
    assert found is not None
    return found[1]


def test_the_table_of_settings_is_the_settings() -> None:
    rows = ["| variable | is | default |", "|---|---|---|"]
    for name, field in ServerSettings.model_fields.items():
        default = "" if field.default in (None, "") else f"`{field.default}`"
        rows.append(f"| `{PREFIX}{name.upper()}` | {field.description} | {default} |")
    assert part("serving.md", "settings") == "\n".join(rows) + "\n"


def test_each_threat_names_tests_that_there_are() -> None:
    lines = part("security.md", "threats").splitlines()[2:]
    assert len(lines) > 12
    for line in lines:
        tests = re.findall(r"`(tests/[^`]+\.py)`", line.rsplit("|", 2)[1])
        assert tests, line
        for test in tests:
            assert "def test_" in (ROOT / test).read_text(encoding="utf-8"), test


@pytest.mark.skipif(shutil.which("curl") is None, reason="no curl")
def test_the_five_requests_are_as_written(server: Running, tmp_path: Path) -> None:
    page = (ROOT / "docs/serving.md").read_text(encoding="utf-8")
    block = page[page.index("## Five requests") :].split("```")[1]
    commands = block.replace("\\\n", " ").split("$ ")[2:]
    assert len(commands) == 5
    (tmp_path / "evals").symlink_to(ROOT / "evals")
    found = {"$SERVER": f"{server.url}/api"}
    last = ""
    for command in commands:
        for name, value in found.items():
            command = command.replace(name, value)
        done = subprocess.run(
            ["/bin/sh", "-c", command.replace("curl ", "curl -sf ")],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, command + done.stderr
        for name, pattern in (("ID", r'"id":"([0-9a-f]+)"'), ("PLAN", r'"plan_id":"([^"]+)"')):
            if name not in found and (value := re.search(pattern, done.stdout)):
                found[name] = value[1]
        last = done.stdout
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")
    ends = ("held", "arrived", "is stopped")  # or it was over, or had not begun, just then
    assert any(end in last for end in ends), last
