"""How anything reaches the terminal: plain or styled, with its control characters visible."""

import sys

from rich.text import Text

from ..tools.visible import visible


def say(text: object, *, error: bool = False, end: str = "\n") -> None:
    """Print on stdout or, where it is no result, on stderr."""
    stream = sys.stderr if error else sys.stdout
    print(visible(str(text)), end=end, file=stream, flush=True)


def draw(escapes: str) -> None:
    """Send a picture of ours to the terminal, as escape sequences."""
    sys.stdout.write(escapes)
    sys.stdout.flush()


def under(text: str, column: int) -> str:
    """Lines after the first moved to a column, where none passes for a line of ours."""
    return text.replace("\n", "\n" + " " * column)


def styled(*parts: str | tuple[str, str], style: str = "") -> Text:
    """Text for a console, of strings and of pairs of a string and its style."""
    pairs = [(part, "") if isinstance(part, str) else part for part in parts]
    return Text.assemble(*((visible(text), how) for text, how in pairs), style=style)
