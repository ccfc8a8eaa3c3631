"""A prompt: a file of front matter and text, in which {{name}} stands for an input or a partial.

Nothing else in the text is special: no logic, no escaping, no spaces within the braces.
"""

import hashlib
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import date
from typing import Annotated

import yaml
from pydantic import BaseModel, ConfigDict, Field, StringConstraints, ValidationError

from .inputs import Input, InputName

VARIABLE = re.compile(r"\{\{([a-z_][a-z0-9_]*)\}\}")
ID, DRAFT = "[a-z][a-z0-9-]*", "draft-[a-z0-9][a-z0-9-]*"
NAME = re.compile(rf"({ID})@(v[0-9]{{3}}|{DRAFT})")
PARTIAL = re.compile(r"([a-z_][a-z0-9_]*)@v[0-9]{3}")
_FILE = re.compile(r"---\n(.*?\n)---\n(.*)", re.DOTALL)

_Id = Annotated[str, StringConstraints(pattern=rf"^{ID}$")]
_Version = Annotated[str, StringConstraints(pattern=rf"^{NAME.pattern}$")]
_Partial = Annotated[str, StringConstraints(pattern=rf"^{PARTIAL.pattern}$")]


class PromptError(ValueError):
    """A prompt that cannot be found, read, rendered or written; the message says how to fix it."""


class FrontMatter(BaseModel):
    """The front matter of a prompt's file, between the lines --- at its head.

    Attributes:
        version: the number of a released version; drafts have none.
        parent: name of the prompt it was made from.
        hypothesis: what it is expected to do better.
        tools: names of the tools offered to the model with it; if empty, all.
        include: partials, each `name@vNNN`, inserted where the text says {{name}}.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: _Id
    version: Annotated[int, Field(strict=True, ge=1, le=999)] | None = None
    summary: str
    parent: _Version | None = None
    hypothesis: str | None = None
    author: str | None = None
    created: date | None = None
    inputs: Mapping[InputName, Input] = {}
    include: tuple[_Partial, ...] = ()
    tools: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()


@dataclass(frozen=True)
class Prompt:
    """One version of a prompt.

    Attributes:
        version: its number, or `draft-NAME`.
        text: the body, with its partials inserted but not its inputs.
        source: the whole file, with line ends as LF.
    """

    front: FrontMatter
    version: int | str
    text: str
    source: str = field(repr=False)

    @property
    def id(self) -> str:
        """The id, which all versions of a prompt share."""
        return self.front.id

    @property
    def tools(self) -> tuple[str, ...]:
        """Names of the tools offered to the model with it; if empty, all."""
        return self.front.tools

    @property
    def sha256(self) -> str:
        """Hash of the text; results cite it, so that changed metadata do not make a new prompt."""
        return hash_of(self.text)

    @property
    def file_sha256(self) -> str:
        """Hash of the file, with line ends as LF; covers inputs, tools and all other metadata."""
        return hash_of(self.source)

    @property
    def name(self) -> str:
        """`id@vNNN` or `id@draft-NAME`."""
        return f"{self.id}@{tag(self.version)}"

    @property
    def facts(self) -> dict[str, str | int]:
        """The facts that reports and traces record about it."""
        return {
            "id": self.id,
            "version": self.version,
            "sha256": self.sha256,
            "file_sha256": self.file_sha256,
        }

    def render(self, values: Mapping[str, object] | None = None) -> str:
        """Return the text with values in place of the inputs; a value left out is its default.

        Raises:
            PromptError: a name is unknown, a value is missing, or an input does not allow it.
        """
        inputs = self.front.inputs
        given = {n: i.default for n, i in inputs.items() if i.default is not None} | dict(
            values or {}
        )
        wrong = [f"there is no input {name!r}" for name in given if name not in inputs]
        wrong += [
            f"{name} ({inputs[name].type}) is missing" for name in inputs if name not in given
        ]
        for name in (n for n in given if n in inputs):
            problem = inputs[name].problem(given[name])
            wrong += [] if problem is None else [f"{name} {problem}"]
        if wrong:
            there = ", ".join(f"{n} ({i.type})" for n, i in inputs.items()) or "none"
            raise PromptError(
                f"{self.name} cannot be rendered: {'; '.join(wrong)}. Its inputs: {there}."
            )
        return VARIABLE.sub(lambda m: inputs[m[1]].written(given[m[1]]), self.text)


def hash_of(text: str) -> str:
    """Return the SHA-256 of a text in UTF-8, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def tag(version: int | str) -> str:
    """Return `vNNN` for a number, and a draft's `draft-NAME` as it is."""
    return f"v{version:03d}" if isinstance(version, int) else version


def parse_prompt(name: str, source: str, partial: Callable[[str], str]) -> Prompt:
    """Parse a prompt from its file.

    Args:
        name: `id@vNNN` or `id@draft-NAME`, as the file's path has it.
        source: the file, with line ends as LF.
        partial: returns the text of a partial, given its `name@vNNN`.

    Raises:
        PromptError: the file is not a valid prompt; names all problems found.
    """
    head, below = split_file(name, source)
    front = _front_matter(name, head)
    id, _, version = name.partition("@")
    texts = {ref.partition("@")[0]: partial(ref) for ref in front.include}
    body = below.strip() + "\n"
    text = VARIABLE.sub(lambda m: texts.get(m[1], m[0]), body)
    number = None if version.startswith("draft-") else int(version[1:])
    wrong = _variable_problems(front, VARIABLE.findall(body), VARIABLE.findall(text))
    if front.id != id:
        wrong.append(f"its id is {front.id!r} but its folder {id!r}")
    if front.version != number:
        wrong.append(f"its version is {front.version} but its file {version}")
    if body == "\n":
        wrong.append("it has no text")
    if wrong:
        raise PromptError(f"{name} cannot be used: {'; '.join(wrong)}.")
    return Prompt(front, number or version, text, source)


def split_file(name: str, source: str) -> tuple[str, str]:
    """Return the front matter of a file and the text below it.

    Raises:
        PromptError: the file has no front matter.
    """
    match = _FILE.fullmatch(source)
    if match is None:
        raise PromptError(f"{name} does not begin with front matter between two lines ---.")
    return match[1], match[2]


def _variable_problems(front: FrontMatter, body: list[str], expanded: list[str]) -> list[str]:
    """Return one clause for each variable that is undeclared, unused or declared twice."""
    included = [ref.partition("@")[0] for ref in front.include]
    unused = [n for n in front.inputs if n not in expanded] + [n for n in included if n not in body]
    undeclared = sorted({n for n in expanded if n not in front.inputs})
    twice = {n for n in included if n in front.inputs or included.count(n) > 1}
    return [
        *(
            f"{{{{{n}}}}} is no input and no partial of it; declare it in inputs"
            for n in undeclared
        ),
        *(f"{n} is declared but {{{{{n}}}}} is not in the text" for n in unused),
        *(f"{n} is declared twice" for n in sorted(twice)),
    ]


def _front_matter(name: str, text: str) -> FrontMatter:
    try:
        return FrontMatter.model_validate(yaml.safe_load(text))
    except ValidationError as error:
        parts = [
            f"{'.'.join(map(str, e['loc'])) or 'it'}: {e['msg'].removeprefix('Value error, ')}"
            for e in error.errors(include_url=False)
        ]
        raise PromptError(f"The front matter of {name} is wrong: {'; '.join(parts)}.") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        why = " ".join(str(error).split())
        raise PromptError(f"The front matter of {name} is no YAML: {why}.") from None
