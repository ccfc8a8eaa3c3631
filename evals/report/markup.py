"""HTML by small functions: whatever is not HTML already is escaped, so forgetting is harmless."""

import html
import re
from collections.abc import Iterable


class Html(str):
    """Text that is HTML."""

    __slots__ = ()


Content = str | Iterable["Content"] | None
Value = str | float | bool | None
VOID = frozenset({"meta", "input", "br"})
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f\ud800-\udfff]")
"""What no HTML file may hold: most control characters, halves of surrogate pairs."""


def text(value: str) -> Html:
    """Text, escaped; HTML as it is."""
    if isinstance(value, Html):
        return value
    return Html(html.escape(CONTROLS.sub("\ufffd", value.replace("\r\n", "\n")), quote=True))


def joined(*content: Content) -> Html:
    """Content one after the other; None is nothing."""
    parts = list[str]()
    for item in content:
        if isinstance(item, str):
            parts.append(text(item))
        elif item is not None:
            parts.append(joined(*item))
    return Html("".join(parts))


def tag(name: str, /, *content: Content, **attributes: Value) -> Html:
    """An element.

    Args:
        name: of the element, ours.
        content: text, which is escaped, or HTML.
        attributes: an underscore stands for a hyphen, one at the end for nothing (class_, for_);
            None and False leave the attribute out, True gives it no value.
    """
    written = [
        f" {_called(key)}" if value is True else f' {_called(key)}="{text(_value(value))}"'
        for key, value in attributes.items()
        if value is not None and value is not False
    ]
    opening = Html(f"<{name}{''.join(written)}>")
    return opening if name in VOID else Html(f"{opening}{joined(*content)}</{name}>")


def _called(key: str) -> str:
    return key.rstrip("_").replace("_", "-")


def _value(value: str | float) -> str:
    return value if isinstance(value, str) else f"{round(value, 1):g}"
