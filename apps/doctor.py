"""`formup doctor`: what is installed and within reach, for bug reports.

It must run in a broken installation too, so it imports other packages only while it checks them.
"""

import io
import json
import os
import platform
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, redirect_stderr, redirect_stdout
from importlib import import_module
from importlib.metadata import packages_distributions, requires, version
from pathlib import Path

from ..tools.errors import StorageError

Looks = Iterator[tuple[str, str, Callable[[], object]]]
PURPOSES = {
    "all": "everyday use",
    "dev": "tests",
    "mcp": "MCP clients",
    "mqtt": "robots on MQTT",
    "otel": "OpenTelemetry spans",
    "postgres": "sessions in PostgreSQL",
    "ray": "evals on a Ray cluster",
    "rl": "reinforcement learning baselines",
    "ros": "robots on ROS",
    "serve": "the HTTP server",
    "sim": "the window of --watch",
    "torch": "neural networks",
}
"""What each extra is for; for other extras, their packages are listed."""
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "firefox")


def findings_text(*, as_json: bool) -> str:
    """Return all findings, as JSON or, for a person, one per line."""
    found: dict[str, dict[str, str]] = {}
    noise = io.StringIO()  # packages may print when imported
    with redirect_stdout(noise), redirect_stderr(noise):
        for looks in (_installed, _surroundings, _storage, _registered):
            try:
                for kind, name, look in looks():
                    found.setdefault(kind, {})[name] = _found_out(look)
            except Exception as error:  # from a library the whole group needs; go on
                found.setdefault("broken", {})[looks.__name__.strip("_")] = str(error)
    if as_json:
        return json.dumps(found, indent=2)
    rows = [(f"{kind} {name}", text) for kind, of in found.items() for name, text in of.items()]
    return "\n".join(f"{name:33} {' '.join(text.split())}" for name, text in rows)


def _found_out(look: Callable[[], object]) -> str:
    """Return what a look finds, or why it failed; other people's code may raise anything."""
    try:
        return str(look())
    except (Exception, SystemExit) as error:
        return f"broken: {type(error).__name__}: {error}"


def _installed() -> Looks:
    yield "program", "formup", lambda: version("formup")
    yield "program", "python", lambda: f"{platform.python_version()} on {platform.platform()}"
    needed: dict[str, list[str]] = {"": []}
    for line in requires("formup") or ():
        extra = re.search(r"""extra == ['"]([^'"]+)""", line)
        needed.setdefault(extra[1] if extra else "", []).append(re.split(r"[^\w.-]", line)[0])
    modules = {(n.lower(), m) for m, names in packages_distributions().items() for n in names}
    for name in needed.pop(""):
        own = [module for package, module in sorted(modules) if package == name.lower()]
        yield "library", name, lambda n=name, own=own: (version(n), *map(import_module, own))[0]
    for extra, names in sorted(needed.items()):
        lacking = [n for n in names if _found_out(lambda n=n: version(n)).startswith("broken")]
        state = f"missing {', '.join(lacking)}" if lacking else "installed"
        yield "extra", extra, f"{state}; for {PURPOSES.get(extra, ', '.join(names))}".strip


def _surroundings() -> Looks:
    shown = sys.platform != "linux" or {"DISPLAY", "WAYLAND_DISPLAY"} & set(os.environ)
    cameras = sorted(Path("/dev").glob("video*"))  # not opened: one may hang
    allowed = [f"{p} {'is' if os.access(p, os.R_OK) else 'is not'} readable" for p in cameras]
    yield "machine", "display", lambda: "available" if shown else "none"
    yield "machine", "browser", lambda: next(filter(shutil.which, BROWSERS), "none on the PATH")
    yield "machine", "camera", lambda: ", ".join(allowed) or "no /dev/video*"
    from ..agent.providers.remote import VARIABLES

    ours = sorted(n for n in os.environ if n.startswith(("FORMUP_", "OTEL_", *VARIABLES)))
    for name in dict.fromkeys((*VARIABLES, *ours)):  # never a value
        yield "variable", name, lambda name=name: "set" if os.environ.get(name) else "not set"


def _storage() -> Looks:
    from ..agent.store.places import data_folder, default_store, store_at

    address = os.environ.get("FORMUP_STORE") or default_store()
    path = address.removeprefix("sqlite:///")
    file = None if "://" in path else Path(path)

    def look() -> str:
        if file is not None and not file.exists():  # looking must not create it
            return f"{_writable(file)}; no sessions"
        with closing(store_at(address)) as store:
            can = _writable(file) if file else f"{store.label} is writable"
            try:
                store.rename("none", "")  # a database checks who may write first
            except StorageError as error:
                can = can if error.kind == "missing" else str(error).rstrip(".")
            number = len(store.sessions())
            return f"{can}; {number} session{'s' * (number != 1)}"

    yield "storage", "data folder", lambda: _writable(data_folder())
    yield "storage", "sessions", look


def _writable(path: Path) -> str:
    there = next(p for p in (path, *path.parents) if p.exists())
    return f"{path} {'is' if os.access(there, os.W_OK) else 'is not'} writable"


def _registered() -> Looks:
    from ..agent.providers.registry import MODELS
    from ..tools.fleet.registry import FLEETS
    from ..tools.perception.detectors.registry import DETECTORS
    from ..tools.perception.segmenters.registry import SEGMENTERS

    for kind in (FLEETS, DETECTORS, SEGMENTERS):
        for name in kind.names():
            home = "built in" if name in kind.builtin else "from an installed package"
            yield kind.noun, name, lambda kind=kind, n=name, home=home: (home, kind.load(n))[0]
    yield "model", "names", ", ".join(MODELS).strip
