"""Text on pictures: the built-in font, substitutes for what it lacks, and line wrapping.

Pillow's own font keeps pictures the same on every machine but covers little more than ASCII,
while instructions come in any language: what it lacks is folded to ASCII or named in brackets.
"""

import re
import unicodedata
from functools import lru_cache

from PIL import Image, ImageDraw, ImageFont

_FOLDS = str.maketrans(
    {
        "ß": "ss", "æ": "ae", "Æ": "AE", "œ": "oe", "Œ": "OE", "ø": "o", "Ø": "O", "ł": "l",
        "Ł": "L", "đ": "d", "ı": "i", "–": "-", "—": "-", "−": "-", "×": "x", "•": "·",
        "→": "->", "←": "<-", "≤": "<=", "≥": ">=", "≈": "~", "¿": "", "¡": "",
    }
)  # fmt: skip
_MISSING = "\uffff"


@lru_cache(maxsize=64)
def font(size: int) -> ImageFont.FreeTypeFont:
    """Return the built-in font at a size in pixels."""
    loaded = ImageFont.load_default(size=max(size, 1))
    assert isinstance(loaded, ImageFont.FreeTypeFont)
    return loaded


def drawable(text: str) -> str:
    """Return the text as one line of characters that the font has.

    Accents are dropped; a run in another script becomes the script's name, such as [Arabic], and
    an emoji its own name, such as [robot face].
    """
    parts: list[str] = []
    last = ""
    for part in map(_substitute, unicodedata.normalize("NFKD", text.translate(_FOLDS))):
        if len(part) > 1 and part == last:
            while parts[-1] == " ":
                parts.pop()
            continue
        if part:
            parts.append(part)
        last = part.strip() or last
    spaced = re.sub(r"(?<=\w)(?=\[)|(?<=\])(?=[\w\[])", " ", "".join(parts))
    return " ".join(spaced.split())


def wrapped(text: str, width: float, face: ImageFont.FreeTypeFont, most: int) -> list[str]:
    """Wrap the text into at most `most` lines of a width in pixels, the last with … if cut."""
    lines: list[str] = []
    words = drawable(text).split()
    while words and len(lines) < most:
        line = words.pop(0)
        while words and face.getlength(f"{line} {words[0]}") <= width:
            line = f"{line} {words.pop(0)}"
        fits = shortened(line, width, face, "")
        if len(fits) < len(line):
            words.insert(0, line[len(fits) :])
        lines.append(fits)
    if words:
        lines[-1] = shortened(f"{lines[-1]} {' '.join(words)}", width, face)
    return lines


def shortened(text: str, width: float, face: ImageFont.FreeTypeFont, mark: str = "…") -> str:
    """Cut a drawable text to a width in pixels, to at least one character, adding a mark if cut."""
    if face.getlength(text) <= width:
        return text
    low, high = 1, len(text)
    while low < high:
        middle = (low + high + 1) // 2
        if face.getlength(text[:middle].rstrip() + mark) <= width:
            low = middle
        else:
            high = middle - 1
    return text[:low].rstrip() + mark


@lru_cache(maxsize=4096)
def _substitute(char: str) -> str:
    """Replace a character by itself, an ASCII digit, a name in brackets, a space, or nothing."""
    category = unicodedata.category(char)
    if char.isspace():
        return " "
    if category[0] in "CM":
        return ""
    if _has_glyph(char):
        return char
    digit = unicodedata.decimal(char, None)
    if digit is not None:
        return str(digit)
    if category[0] == "P":
        return " "
    name = unicodedata.name(char, "unknown character")
    return f"[{name.lower()}]" if category[0] == "S" else f"[{_script_name(name)}]"


def _script_name(name: str) -> str:
    word = name.split()[0]
    return "Han" if word == "CJK" else word.capitalize()


def _has_glyph(char: str) -> bool:
    """Return whether the font has a glyph of its own for a character."""
    return _glyph_bitmap(char) != _glyph_bitmap(_MISSING)


def _glyph_bitmap(char: str) -> bytes:
    image = Image.new("L", (40, 40))
    ImageDraw.Draw(image).text((10, 5), char, 255, font(20))
    return image.tobytes()
