import re
from pathlib import Path

from formup.apps.server.settings import PREFIX, ServerSettings

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
