"""A linter for prompts: errors and likely errors that show without running them."""

import re
import unicodedata
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from .library import PromptLibrary, names_in
from .lock import read_lock
from .prompt import NAME, VARIABLE, Prompt, PromptError

LINE = 100
"""Longest line, in characters, that can still be read at a glance."""
TOKENS, CHARACTERS = 1500, 4
"""Token budget of a prompt, and characters per token; every request pays for the tokens again."""
_SECRET = re.compile(
    r"\b(?:sk|pk|rk)[-_][A-Za-z0-9_-]{16,}|\bAIza[A-Za-z0-9_-]{30,}|\bgh[pousr]_[A-Za-z0-9]{20,}"
    r"|\bgithub_pat_\w{20,}|\bAKIA[A-Z0-9]{16}\b|\bxox[abprs]-[A-Za-z0-9-]{10,}|\bhf_[A-Za-z0-9]{20,}"
    r"|\beyJ[A-Za-z0-9_-]{10,}\.[A-Za-z0-9_-]{10,}|-----BEGIN [A-Z ]*PRIVATE KEY"
    r"|(?i:\bbearer\s+[A-Za-z0-9._-]{20,})"
)
_BRACES = re.compile(r"\{\{.*?\}\}")
_LENGTHS = re.compile(r"\b(?:coordinates?|outlines?|vertices|distances?|lengths?)\b|\(x, y\)", re.I)
_UNIT = re.compile(r"\b(?:px|pixels?|m|cm|mm|metres?|meters?)\b", re.I)
_ORIGIN = re.compile(r"\by\b[^.\n]{0,20}\b(?:down|up)", re.I)
_WORDS = (
    *("one", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)
_NUMBER = rf"(?:[0-9]+|{'|'.join(_WORDS)})"
_COUNT = re.compile(
    rf"(?<![\w.,@])({_NUMBER})(?:\s+(?:to|or)\s+({_NUMBER}))?\s+([a-z]{{4,}})\b", re.I
)


@dataclass(frozen=True)
class Finding:
    """A finding about one prompt: an error is always wrong, a warning may be intended."""

    prompt: str
    rule: str
    severity: Literal["error", "warning"]
    sentence: str


def lint(library: PromptLibrary, names: Iterable[str] | None = None) -> list[Finding]:
    """Return all findings about the named prompts; for None, about all prompts and their folders.

    Raises:
        PromptError: there is no prompt of a name, or the user's folder cannot be read.
    """
    chosen = library.names() if names is None else [library.resolve(n) for n in names]
    found = [finding for name in chosen for finding in _lint_prompt(library, name)]
    if names is None:
        found += [finding for id in library.ids() for finding in _lint_folder(library, id)]
    return found


def _lint_prompt(library: PromptLibrary, name: str) -> list[Finding]:
    """Lint one prompt; one that cannot be loaded gives a single error."""
    try:
        prompt = library.load(name)
    except PromptError as error:
        return [Finding(name, "unusable", "error", str(error))]
    found = [*_lint_source(prompt), *_lint_text(prompt), *_lint_counts(prompt)]
    parent = prompt.front.parent
    if parent is not None and parent not in library.names():
        found.append(Finding(name, "parent", "warning", f"Its parent {parent} is not there."))
    return found


def _lint_folder(library: PromptLibrary, id: str) -> Iterator[Finding]:
    """Lint the folder of an id: missing released files, CURRENT, and file names."""
    home = library.home(id)
    names = names_in(home, id)
    try:
        for name in sorted(read_lock(home).keys() - set(names)):
            if name.startswith(f"{id}@"):
                text = f"{name} was released, but its file is gone; put it back."
                yield Finding(name, "released", "error", text)
        if any("@v" in name for name in names):
            library.current(id)
    except PromptError as error:
        yield Finding(id, "current", "error", str(error))
    for path in sorted((home / id).glob("*.md")):
        name = f"{id}@{path.name.removesuffix('.prompt.md')}"
        if path.name.endswith(".prompt.md") and not NAME.fullmatch(name):
            text = f"{path} is neither vNNN.prompt.md nor draft-NAME.prompt.md and is not read."
            yield Finding(id, "name", "warning", text)


def _lint_source(prompt: Prompt) -> Iterator[Finding]:
    """Lint the source line by line."""
    for number, line in enumerate(prompt.source.splitlines(), start=1):
        if line != line.rstrip():
            yield _error(prompt, "spaces", f"Line {number} ends in spaces; models read them too.")
        if len(line) > LINE:
            text = f"Line {number} has {len(line)} characters; {LINE} are read at a glance."
            yield Finding(prompt.name, "line", "warning", text)
        strange = sorted(set(_confusable(line)))
        if strange:
            names = ", ".join(f"U+{ord(c):04X} {unicodedata.name(c, '?').lower()}" for c in strange)
            text = f"Line {number} has characters that look like others or like nothing: {names}."
            yield _error(prompt, "confusable", text)
        if _SECRET.search(line):
            text = f"Line {number} holds what looks like a key; prompts are sent and kept."
            yield _error(prompt, "secret", text)


def _lint_text(prompt: Prompt) -> Iterator[Finding]:
    """Lint the text sent to the model, and the metadata about it."""
    front, text = prompt.front, prompt.text
    odd = [braces for braces in _BRACES.findall(text) if not VARIABLE.fullmatch(braces)]
    for braces in sorted(set(odd)):
        sentence = (
            f"{braces} is no variable and stays as it is; write {{{{name}}}} with a-z, 0-9, _."
        )
        yield Finding(prompt.name, "braces", "warning", sentence)
    for name, given in front.inputs.items():
        if given.example is None and given.default is None:
            sentence = f"The input {name} has no example; give it one, or a default."
            yield _error(prompt, "example", sentence)
    if isinstance(prompt.version, str) and not (front.hypothesis or "").strip():
        sentence = "The draft has no hypothesis: what should be better with it?"
        yield Finding(prompt.name, "hypothesis", "warning", sentence)
    tokens = -(-len(text) // CHARACTERS)
    if tokens > TOKENS:
        sentence = f"It takes some {tokens:,} tokens in every request; {TOKENS:,} are the budget."
        yield Finding(prompt.name, "budget", "warning", sentence)
    if _LENGTHS.search(text):
        missing = [what for what, way in _FRAME.items() if not way.search(text)]
        if missing:
            sentence = (
                f"It speaks of coordinates or lengths but does not say {' or '.join(missing)}."
            )
            yield Finding(prompt.name, "frame", "warning", sentence)


_FRAME = {"their unit": _UNIT, "which way y runs": _ORIGIN}


def _lint_counts(prompt: Prompt) -> Iterator[Finding]:
    """Warn of different counts of one noun, such as 8 to 12 vertices here and 20 vertices there."""
    found: dict[str, dict[str, str]] = {}
    for match in _COUNT.finditer(prompt.text):
        low, high, noun = match.groups()
        bounds = "-".join(_digits(n) for n in (low, high) if n)
        noun = noun.lower().removesuffix("s")
        if noun not in _NO_NOUNS:
            found.setdefault(noun, {})[bounds] = " ".join(match[0].split())
    for phrases in (list(counts.values()) for counts in found.values() if len(counts) > 1):
        text = f"It says {', '.join(phrases)}: do they agree?"
        yield Finding(prompt.name, "counts", "warning", text)


_NO_NOUNS = {"from", "that", "thi", "with", "each", "more", "other", "time", "then", "will"}


def _digits(number: str) -> str:
    word = number.lower()
    return str(_WORDS.index(word) + 1) if word in _WORDS else word


_PLAIN = " \t\u200c\u200d"
"""Space, tab, and the zero-width joiners that some scripts need."""


def _confusable(line: str) -> Iterator[str]:
    """Yield invisible characters, odd spaces, ASCII lookalikes and foreign letters in a word."""
    for char in line:
        hidden = unicodedata.category(char) in ("Cf", "Zs", "Cc", "Co") and char not in _PLAIN
        compatible = not char.isascii() and unicodedata.normalize("NFKC", char).isascii()
        if hidden or (compatible and char.isalnum()):
            yield char
    for word in re.findall(r"[^\W\d_]+", line):
        if any(c.isascii() for c in word):
            yield from (c for c in word if _script_of(c) in ("CYRILLIC", "GREEK", "ARMENIAN"))


def _script_of(char: str) -> str:
    return unicodedata.name(char, "").partition(" ")[0]


def _error(prompt: Prompt, rule: str, sentence: str) -> Finding:
    return Finding(prompt.name, rule, "error", sentence)
