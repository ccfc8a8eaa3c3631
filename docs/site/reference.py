"""The reference: its pages, those on Python among them, and how docstrings are read."""

import inspect
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, get_type_hints

import formup
from generated import commands, fleet, http, schemas, tools
from pydantic import BaseModel
from sphinx.application import Sphinx
from sphinx.ext.napoleon import Config
from sphinx.ext.napoleon.docstring import GoogleDocstring
from sphinx.util.inspect import stringify_signature

PAGES = [
    ("Python", "reference/python"),
    ("Python, to extend it", "reference/extending"),
    ("Every command", "reference/commands"),
    ("Tools that models see", "reference/tools"),
    ("HTTP", "reference/http"),
    ("Fleet files", "reference/fleet"),
]
"""Titles in the navigation, and the pages without their suffix."""

MODULES = {
    "Models": ("agent.model", "agent.providers.registry"),
    "Sessions and stores": ("agent.store.protocol", "agent.store.copies", "agent.export"),
    "Fleets": ("tools.fleet.protocol", "tools.fleet.conformance", "tools.fleet.trajectories"),
    "Motion": ("tools.motion.motion", "tools.motion.following"),
    "Perception": (
        *("tools.perception.detection", "tools.perception.detectors.protocol"),
        "tools.perception.segmenters.protocol",
    ),
    "Edits": ("tools.formation.editing.edits", "tools.formation.editing.edit_kinds"),
    "Errors": ("tools.errors",),
}
"""Modules that an extension implements or calls, beside what `import formup` gives."""

FACE = {
    "Agents and conversations": "Agent Service Run load_run store_at is_stop Limits Policy Report",
    "How a run ends": "Answered Paused Stopped Cancelled",
    "Pictures and things": "Picture load_picture picture_from_bytes TargetPrompt Target "
    "Outline make_outline",
    "Contracts, plans, certificates": "Contract Group Formation Plan make_plan certify Verdict "
    "Finding Arrival World",
    "Tools": "tool Tool ToolResult Context Settings",
    "Models": "User Reply Call Result FunctionModel ScriptedModel",
    "Errors": "FormupError InputError ImageError ToolError ModelError FleetError",
}


def write(folder: Path) -> None:
    """Write every page anew."""
    made = {
        "tools.md": tools(),
        "http.md": http(),
        "fleet.md": fleet(),
        **python_face(),
        **python_modules(),
        **commands(),
        **schemas(),
    }
    shutil.rmtree(folder, ignore_errors=True)
    for name, text in made.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def autodoc(directive: str, name: str, without: Iterable[str] = ()) -> str:
    """Documentation of an object and what is in it, from their docstrings."""
    lines = [f".. {directive}:: {name}"]
    if directive != "autofunction":
        lines += ["   :members:", f"   :exclude-members: {', '.join(['model_config', *without])}"]
    return "```{eval-rst}\n" + "\n".join(lines) + "\n```\n"


def python_face() -> dict[str, str]:
    """What `import formup` gives, a page for each of its groups."""
    groups = {title: names.split() for title, names in FACE.items()}
    grouped = {name for names in groups.values() for name in names} | {"TOOLS"}
    groups["More"] = [name for name in formup.__all__ if name not in grouped]
    pages: dict[str, list[str]] = {}
    for title, names in groups.items():
        kinds = {n: inspect.isfunction(getattr(formup, n)) for n in names}
        pages[title] = [
            autodoc("autofunction" if function else "autoclass", f"formup.{name}")
            for name, function in kinds.items()
        ]
    pages["Tools"].append(
        "```{py:data} formup.TOOLS\nThe [tools](../tools.md) that come with formup; "
        "`Agent(tools=(*TOOLS, yours))` adds one.\n```\n"
    )
    about = "What `import formup` gives. [From Python](../python.md) shows it at work."
    return chapters("python", "Python", about, pages)


def python_modules() -> dict[str, str]:
    """Protocols to implement and functions beside the public face."""
    pages = {
        title: [
            part
            for name in names
            for part in (
                f"## formup.{name}\n",
                autodoc("automodule", f"formup.{name}", formup.__all__),
            )
        ]
        for title, names in MODULES.items()
    }
    about = "What models, stores, fleets and detectors implement, and what helps with it."
    return chapters("extending", "Python, to extend it", about, pages)


def chapters(
    folder: str, title: str, about: str, pages: Mapping[str, Sequence[str]]
) -> dict[str, str]:
    """Pages in a folder, and one that leads to them; those that would be empty are left out."""
    made = {
        f"{folder}/{slug(name)}.md": "\n".join([f"# {name}\n", *parts])
        for name, parts in pages.items()
        if parts
    }
    entries = "\n".join(name.removesuffix(".md") for name in made)
    tree = f"```{{toctree}}\n:maxdepth: 1\n\n{entries}\n```\n"
    return {**made, f"{folder}.md": f"# {title}\n\n{about}\n\n{tree}"}


def slug(title: str) -> str:
    """A title as the name of a file."""
    return "-".join(re.findall(r"\w+", title.lower()))


def sign(_app: Sphinx, what: str, _name: str, found: Any, *_: Any) -> tuple[str, str] | None:
    """Fields of a pydantic model with plain types: what restricts them is in the JSON Schemas."""
    if what != "class" or not issubclass(found, BaseModel):
        return None
    hints = get_type_hints(found)
    parameters = [
        inspect.Parameter(
            field,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if info.is_required() else info.get_default(),
            annotation=hints[field],
        )
        for field, info in found.model_fields.items()
    ]
    return stringify_signature(inspect.Signature(parameters), unqualified_typehints=True), ""


def read_docstring(
    app: Sphinx, what: str, name: str, found: Any, options: Any, lines: list[str]
) -> None:
    """Google's sections; what precedes a colon is a type only in sections."""
    kind: Any = "method" if what in ("property", "attribute", "data") else what
    style: Any = Config(napoleon_use_ivar=True, napoleon_use_rtype=False)
    lines[:] = GoogleDocstring(lines, style, app, kind, name, found, options).lines()
