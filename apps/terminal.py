"""Output to the terminal, plain or styled, with control characters made visible."""

import sys

from rich.text import Text

from ..tools.visible import visible


def say(text: object, *, error: bool = False, end: str = "\n") -> None:
    """Print on stdout, or, with `error`, for what is not a result, on stderr."""
    stream = sys.stderr if error else sys.stdout
    print(visible(str(text)), end=end, file=stream, flush=True)


def draw(escapes: str) -> None:
    """Send one of our own pictures to the terminal, as escape sequences."""
    sys.stdout.write(escapes)
    sys.stdout.flush()


def under(text: str, column: int) -> str:
    """Indent all lines but the first to a column, so that none passes for a line of formup's."""
    return text.replace("\n", "\n" + " " * column)


def styled(*parts: str | tuple[str, str], style: str = "") -> Text:
    """Build a console's text from strings and pairs of a string and its style."""
    pairs = [(part, "") if isinstance(part, str) else part for part in parts]
    return Text.assemble(*((visible(text), how) for text, how in pairs), style=style)
