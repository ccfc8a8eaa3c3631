"""The Containerfile and compose.yaml, read as builders read them; nothing is built here."""

import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any, cast

import pytest
import yaml

ROOT = Path(__file__).parent.parent
PORT = "8734"
INSTRUCTIONS = {
    *("ADD", "ARG", "CMD", "COPY", "ENTRYPOINT", "ENV", "EXPOSE", "FROM", "HEALTHCHECK", "LABEL"),
    *("ONBUILD", "RUN", "SHELL", "STOPSIGNAL", "USER", "VOLUME", "WORKDIR"),
}
OURS = {"FORMUP_HOST", "FORMUP_PORT", "FORMUP_STORE", "FORMUP_TOKENS_FILE", "FORMUP_MODEL"}
COMPOSE = cast("dict[str, Any]", yaml.safe_load((ROOT / "compose.yaml").read_text("utf-8")))
SERVICES = cast("dict[str, dict[str, Any]]", COMPOSE["services"])


def steps() -> list[tuple[str, str]]:
    """Instructions of the Containerfile and what is given to them."""
    text = re.sub(r"\\\n\s*", "", (ROOT / "Containerfile").read_text("utf-8"))
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [(name, given.strip()) for name, _, given in (line.partition(" ") for line in lines)]


def given(instruction: str) -> list[str]:
    return [words for name, words in steps() if name == instruction]


def test_instructions_are_known_and_each_stage_begins_from_a_tag() -> None:
    assert {name for name, _ in steps()} <= INSTRUCTIONS
    assert steps()[0][0] == "FROM"
    images = [words.split()[0] for words in given("FROM")]
    images += [service["image"] for service in SERVICES.values() if "image" in service]
    for image in images:
        assert re.fullmatch(r"docker\.io/library/(python|postgres):\d[\w.-]*", image), image
    assert not re.search("latest", (ROOT / "Containerfile").read_text("utf-8"))


def test_what_is_copied_is_there_and_is_all_that_is_installed() -> None:
    copied: set[str] = set()
    for words in given("COPY"):
        *sources, _ = shlex.split(words)
        if not sources[0].startswith("--from="):
            copied |= set(sources)
    assert [name for name in copied if not (ROOT / name).exists()] == []
    ignored = (ROOT / ".dockerignore").read_text("utf-8").split()
    assert not copied & set(ignored)
    package = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]
    rooms = {name.split(".")[1] for name in package["packages"] if "." in name}
    rooms |= {name.split("/")[0] for name in package["package-data"]["formup"] if "/" in name}
    inner = {name for name in copied if "/" in name or (ROOT / name).is_dir()}
    assert rooms == {name.split("/")[0] for name in inner}
    assert {"pyproject.toml", "constraints.txt", "README.md", "LICENSE"} <= copied
    stages = {words.split()[-1] for words in given("FROM") if " AS " in words}
    assert {w.split()[0] for w in given("COPY") if w.startswith("--from=")} == {
        f"--from={stage}" for stage in stages
    }


def test_it_runs_as_nobody_special_and_serves() -> None:
    last = [name for name, _ in steps()].index("USER")
    assert [int(part) > 0 for part in given("USER")[0].split(":")] == [True, True]
    assert not [name for name, _ in steps()[last:] if name in ("RUN", "COPY", "ADD")]
    (entry,), (command,) = given("ENTRYPOINT"), given("CMD")
    assert json.loads(entry) + json.loads(command) == ["formup", "serve", "--host", "0.0.0.0"]
    assert given("EXPOSE") == [PORT]
    (check,) = given("HEALTHCHECK")
    program = json.loads(check.partition("CMD ")[2])
    assert program[:2] == ["python", "-c"]
    assert f"http://127.0.0.1:{PORT}/health/ready" in program[2]
    compile(program[2], "health check", "exec")


def test_no_secret_stands_in_either() -> None:
    for service in SERVICES.values():
        for name, value in service["environment"].items():
            if re.search("PASSWORD|KEY|TOKEN$", name):
                assert value is None or re.fullmatch(r"\$\{\w+:\?[^}]+\}", value), name
    assert not [words for words in given("ENV") + given("ARG") if re.search("KEY|TOKEN", words)]


def test_the_server_waits_for_a_database_that_is_kept_and_well() -> None:
    assert set(SERVICES) == {"formup", "database"}
    server, database = SERVICES["formup"], SERVICES["database"]
    assert server["build"] == {"context": ".", "dockerfile": "Containerfile"}
    assert {n for n in server["environment"] if n.startswith("FORMUP_")} <= OURS
    assert re.fullmatch(
        r"postgresql://formup:\$\{\w+:\?.*\}@database/formup", server["environment"]["FORMUP_STORE"]
    )
    assert server["environment"]["FORMUP_TOKENS_FILE"] == "/run/secrets/tokens"
    assert server["secrets"] == list(COMPOSE["secrets"]) == ["tokens"]
    assert server["depends_on"]["database"]["condition"] == "service_healthy"
    assert server["ports"] == [f"127.0.0.1:{PORT}:{PORT}"]
    assert (server["read_only"], server["cap_drop"]) == (True, ["ALL"])
    assert ":18" in database["image"]
    assert database["healthcheck"]["test"][:2] == ["CMD", "pg_isready"]
    assert database["volumes"] == ["database:/var/lib/postgresql"], "where 18 keeps its data"


@pytest.mark.parametrize("name", sorted(SERVICES))
def test_volumes_are_declared(name: str) -> None:
    mounted = {volume.partition(":")[0] for volume in SERVICES[name]["volumes"]}
    assert mounted <= set(COMPOSE["volumes"])
    assert SERVICES[name]["restart"] == "unless-stopped"


def test_the_page_names_what_the_server_reads() -> None:
    page = (ROOT / "docs/containers.md").read_text("utf-8")
    assert set(re.findall(r"FORMUP_\w+", page)) == OURS | {"FORMUP_DATABASE_PASSWORD"}
