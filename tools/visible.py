"""Makes text from elsewhere safe to show: what would control a terminal or a page is escaped.

Models, tools, files and prompts may hold escape sequences that recolour, hide or overwrite what
was printed, and marks that reverse the order of letters.
"""

import json
from unicodedata import category

STAY = frozenset("\n\t\u200c\u200d")
"""Left as they are: line ends, tabs, and the two joiners of Persian, Indic scripts and emoji."""


def visible(text: str) -> str:
    """Return text with control and format characters, C1 and bidi too, written as `\\u001b`.

    The escapes are those of JSON: JSON stays the same value.
    """
    return text if text.isprintable() else "".join(map(_written_out, text))


def _written_out(character: str) -> str:
    plain = character.isprintable() or character in STAY or category(character) == "Zs"
    return character if plain else json.dumps(character)[1:-1]
