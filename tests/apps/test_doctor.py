"""`formup doctor`: what it says, what it never shows, and that nothing broken stops it."""

import json
import os
import subprocess
import sys
from importlib.metadata import metadata, version
from pathlib import Path

import pytest
from formup.agent.providers.remote import VARIABLES
from formup.agent.store.places import store_at
from formup.apps.doctor import PURPOSES

SECRET = "sk-live-4f9b1c77aa"
PLUGINS = {
    "wheels": "wheels:open_fleet",
    "absent": "nowhere:open_fleet",
    "raises": "raising:open_fleet",
    "leaves": "leaving:open_fleet",
}


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A folder with packages that are imported before others of their name."""
    (tmp_path / "packages").mkdir()
    return tmp_path


def doctor(home: Path, *options: str, **variables: str) -> subprocess.CompletedProcess[str]:
    keep = {n: v for n, v in os.environ.items() if not n.startswith(("FORMUP_", *VARIABLES))}
    path = os.pathsep.join([str(home / "packages"), os.environ.get("PYTHONPATH", "")])
    keep |= {"PYTHONPATH": path, "XDG_DATA_HOME": str(home / "data")}
    command = [sys.executable, "-m", "formup", *(options or ("doctor", "--json"))]
    return subprocess.run(
        command, env=keep | variables, cwd=home, capture_output=True, text=True, check=False
    )


def told(home: Path, **variables: str) -> dict[str, dict[str, str]]:
    done = doctor(home, **variables)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    return json.loads(done.stdout)


def write(home: Path, **modules: str) -> None:
    for name, text in modules.items():
        (home / f"packages/{name}.py").write_text(text)


def test_it_says_what_is_there_and_makes_nothing(home: Path) -> None:
    found = told(home)
    assert found["program"]["formup"] == version("formup")
    assert found["library"]["numpy"] == version("numpy")
    assert not [text for text in found["library"].values() if "broken" in text]
    assert set(found["extra"]) == set(metadata("formup").get_all("Provides-Extra") or ())
    assert set(PURPOSES) <= set(found["extra"])
    assert found["extra"]["postgres"] == "installed; for sessions in PostgreSQL"
    assert found["variable"] == dict.fromkeys(VARIABLES, "not set")
    assert set(found["machine"]) == {"display", "browser", "camera"}
    assert found["storage"] == {
        "data folder": f"{home / 'data/formup'} is writable",
        "sessions": f"{home / 'data/formup/sessions.db'} is writable; no sessions",
    }
    for kind, name in (("fleet", "simulated"), ("detector", "standout"), ("segmenter", "grabcut")):
        assert found[kind][name] == "built in"
        assert set(found[kind].values()) == {"built in"}
    assert "anthropic:NAME" in found["model"]["names"]
    assert list(home.iterdir()) == [home / "packages"]


def test_for_a_person_each_thing_is_a_line(home: Path) -> None:
    rows = doctor(home, "doctor").stdout.splitlines()
    found = told(home)
    assert len(rows) == sum(map(len, found.values()))
    assert f"{'fleet simulated':33} built in" in rows


def test_values_of_variables_are_never_shown(home: Path) -> None:
    names = (*VARIABLES, "OPENAI_API_KEY_FILE", "FORMUP_PROMPTS", "OTEL_EXPORTER_OTLP_HEADERS")
    done = doctor(home, **dict.fromkeys(names, SECRET))
    found = json.loads(done.stdout)["variable"]
    assert {name: found[name] for name in names} == dict.fromkeys(names, "set")
    assert SECRET not in done.stdout + done.stderr
    assert told(home, OPENAI_API_KEY="")["variable"]["OPENAI_API_KEY"] == "not set"


@pytest.mark.parametrize(
    "address",
    [
        f"postgresql://me:{SECRET}@127.0.0.1:1/talks",
        f"postgresql://127.0.0.1:1/talks?password={SECRET}",
        f"mysql://me:{SECRET}@127.0.0.1/talks",
    ],
)
def test_a_store_that_is_out_of_reach_is_one_line_without_its_password(
    address: str, home: Path
) -> None:
    done = doctor(home, FORMUP_STORE=address)
    assert json.loads(done.stdout)["storage"]["sessions"].startswith("broken: ")
    assert SECRET not in done.stdout + done.stderr


@pytest.mark.parametrize("address", ["sqlite:///talks.db", "talks"])
def test_sessions_are_counted(address: str, home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(home)
    store = store_at(address)
    store.create("One")
    store.create("Two")
    store.close()
    where = address.removeprefix("sqlite:///")
    counted = told(home, FORMUP_STORE=address)["storage"]["sessions"]
    assert counted == f"{where} is writable; 2 sessions"


def test_plugins_that_are_broken_are_named_and_print_nothing_on_stdout(home: Path) -> None:
    facts = home / "packages/plugins-1.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: plugins\nVersion: 1\n")
    entries = [f"{name} = {value}\n" for name, value in PLUGINS.items()]
    (facts / "entry_points.txt").write_text(f"[formup.fleets]\n{''.join(entries)}")
    write(
        home,
        wheels="print('hello')\ndef open_fleet(request): ...",
        raising="raise RuntimeError('no licence\\nfound')",
        leaving="raise SystemExit('bye')",
    )
    fleets = told(home)["fleet"]
    assert fleets.pop("wheels") == "from an installed package"
    ours = ("simulated", "mqtt", "recorded", "ros", "vda5050")
    assert {fleets.pop(name) for name in ours} == {"built in"}
    assert fleets == {
        "absent": "broken: InputError: The fleet 'absent' (nowhere:open_fleet) cannot be "
        "imported: No module named 'nowhere'.",
        "raises": "broken: RuntimeError: no licence\nfound",
        "leaves": "broken: SystemExit: bye",
    }


@pytest.mark.parametrize("library", ["numpy", "typer", "sqlalchemy"])
def test_a_library_that_is_broken_is_named_by_itself_alone(library: str, home: Path) -> None:
    write(home, **{library: "raise ImportError('libc.so.9: cannot open shared object file')"})
    found = told(home)
    broken = {name for name, text in found["library"].items() if "libc.so.9" in text}
    assert library in broken
    assert set(found) >= {"program", "library", "extra", "machine"}
    other = doctor(home, "sessions", "list")
    assert (other.returncode, other.stdout) == (2, "")
    assert "libc.so.9: cannot open shared object file; formup doctor shows" in other.stderr
    assert "Traceback" not in other.stderr
