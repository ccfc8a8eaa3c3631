"""Control characters are written out; other text, in whatever script, stays as it is."""

import json
import unicodedata

import pytest
from formup.tools.visible import visible


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[2K\rcertified", "\\u001b[2K\\rcertified"),
        ("a\x00b\x07\x08\x7f", "a\\u0000b\\u0007\\b\\u007f"),
        ("C1 \x9b31m and \x85", "C1 \\u009b31m and \\u0085"),
        ("\u202edeifitrec\u2066\u200f", "\\u202edeifitrec\\u2066\\u200f"),
        ("half \ud800, lines \u2028, mark \ufeff", "half \\ud800, lines \\u2028, mark \\ufeff"),
        ("tag \U000e0041", "tag \\udb40\\udc41"),
    ],
)
def test_control_characters_are_written_out(text: str, shown: str) -> None:
    assert visible(text) == shown


@pytest.mark.parametrize(
    "text",
    [
        "",
        "two\nlines\tand a tab",
        "n\u00e4chste Stra\u00dfe\u00a0\u2013 \u8eca\u3000\u0633\u200c\u0627",
        "\U0001f469\u200d\U0001f680",
    ],
)
def test_text_of_any_script_stays(text: str) -> None:
    assert visible(text) == text


def test_no_control_character_is_left() -> None:
    everything = "".join(map(chr, range(0x110000)))
    left = {c for c in visible(everything) if unicodedata.category(c) in ("Cc", "Cf", "Cs")}
    assert left == {"\n", "\t", "\u200c", "\u200d"}


def test_json_stays_the_same_value() -> None:
    value = {"text": "\x1b[31m \x7f \x9b \u202e \U000e0041\n"}
    written = visible(json.dumps(value, ensure_ascii=False))
    assert written.isprintable()
    assert json.loads(written) == value
