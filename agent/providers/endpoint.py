"""The server of a model and the key for it. Keys appear in no text, no repr and no error."""

import ipaddress
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast
from unicodedata import normalize
from urllib.parse import unquote, urlsplit

from ...tools.errors import InputError

SHORTEST_KEY = 8
"""Fewest characters of a secret key; people give servers that want none a word such as "none"."""
_KEYS_COME = "Keys come from the environment."
MOST_KEY = 8_192
"""Most characters of a key; a file with more holds something else."""


@dataclass(frozen=True)
class Endpoint:
    """A server and the key for it.

    Attributes:
        base_url: without a trailing slash.
        key: None where none is needed or known.
        key_advice: what to do when the server does not accept the key.
    """

    base_url: str
    key: str | None = field(repr=False)
    key_advice: str

    @property
    def is_loopback(self) -> bool:
        """Whether the server is on this machine, which no proxy can reach."""
        host = urlsplit(self.base_url).hostname or ""
        try:
            return ipaddress.ip_address(host).is_loopback
        except ValueError:
            return host == "localhost"

    def without_key(self, text: str) -> str:
        """Return a text with the key struck out: some servers repeat it in their errors."""
        return text.replace(self.key, "[key]") if self.key else text

    def masked(self, value: Any) -> Any:
        """Return a reply's JSON with the key struck out, unless it is as short as "none"."""
        if isinstance(value, str) and len(self.key or "") >= SHORTEST_KEY:
            return self.without_key(value)
        if isinstance(value, dict):
            fields = cast("dict[Any, Any]", value)
            return {self.masked(name): self.masked(held) for name, held in fields.items()}
        if isinstance(value, list | tuple):
            return [self.masked(held) for held in cast("list[Any]", value)]
        return value

    def masking(self, show: Callable[[str], object]) -> Callable[..., None]:
        """Return a `show` that strikes the key out, even where it is split across fragments."""
        held, key = "", self.key or ""

        def shown(text: str, *, last: bool = False) -> None:
            nonlocal held
            text = str(self.masked(held + text))
            ends = range(0 if last else len(key) - 1, 0, -1)
            held = next((key[:n] for n in ends if text.endswith(key[:n])), "")
            if now := text.removesuffix(held):
                show(now)

        return shown


def endpoint(base_url: str, *variables: str) -> Endpoint:
    """Return an endpoint with the key that the environment holds for it.

    Args:
        base_url: such as https://api.openai.com/v1.
        variables: environment variables for the key, of which the first that is set counts; the
            same name with _FILE may name a file that holds it. Given none, no key is sent.

    Raises:
        InputError: no usable URL, or a key is needed and there is none.
    """
    url = _checked_url(base_url)
    if not variables:
        return Endpoint(url, None, "it asks for a key, and none is sent to such a server")
    given = [v for v in variables if os.environ.get(v) or os.environ.get(f"{v}_FILE")]
    variable = (given or variables)[0]
    found = Endpoint(url, _key_from_environment(variable), f"check the key in {variable}")
    if found.key is None and not found.is_loopback:
        raise InputError(
            f"No key for {url}: set {variable}, or {variable}_FILE to a file that holds it."
        )
    return found


def _checked_url(base_url: str) -> str:
    advice = "give one such as http://127.0.0.1:8000/v1"
    if "@" in normalize("NFKC", unquote(unquote(base_url))):  # first, even if the rest is malformed
        raise InputError(f"The base URL holds a name or a password; {advice}. {_KEYS_COME}")
    if "?" in base_url or "#" in base_url:  # not quoted: what follows may be a key
        raise InputError(f"The base URL holds more than a path; {advice}. {_KEYS_COME}")
    try:
        parts = urlsplit(base_url)
        usable = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        raise InputError(f"The base URL cannot be read; {advice}.") from None
    if not usable or not base_url.isascii() or not base_url.isprintable() or " " in base_url:
        raise InputError(f"{base_url!r} is no base URL of a server; {advice}.")
    return base_url.rstrip("/")


def _key_from_environment(variable: str) -> str | None:
    key, source = os.environ.get(variable, "").strip(), variable
    path = os.environ.get(f"{variable}_FILE", "")
    if not key and path:
        source = f"the file that {variable}_FILE names"
        try:
            with Path(path).open(encoding="utf-8") as file:
                key = file.read(MOST_KEY + 1).strip()
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "no text"
            raise InputError(
                f"{variable}_FILE names {path}, which cannot be read: {why}."
            ) from None
        if not key or len(key) > MOST_KEY:
            why = f"holds more than {MOST_KEY:,} characters" if key else "is empty"
            raise InputError(
                f"{variable}_FILE names {path}, which {why}: name a file with the key."
            )
    if not (key.isascii() and key.isprintable()) or " " in key:
        raise InputError(f"The key in {source} holds characters that no key has.")
    return key or None
