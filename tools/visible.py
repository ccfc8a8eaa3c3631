"""Text from elsewhere, safe to show: what would steer a terminal or a page is written out.

Models, tools, files and prompts may hold escape sequences that recolour, hide or overwrite what
was printed, and marks that turn the order of letters around.
"""

import json
from unicodedata import category

STAY = frozenset("\n\t\u200c\u200d")
"""Line ends, tabs, and the two joiners that Persian, Indic scripts and emoji are written with."""


def visible(text: str) -> str:
    """The text with each control or format character, C1 and bidi included, written as `\\u001b`.

    The escapes are those of JSON: JSON stays the same value.
    """
    return text if text.isprintable() else "".join(map(_written_out, text))


def _written_out(character: str) -> str:
    plain = character.isprintable() or character in STAY or category(character) == "Zs"
    return character if plain else json.dumps(character)[1:-1]
