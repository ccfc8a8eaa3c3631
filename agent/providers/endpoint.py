"""Where a model is asked and with which key. Keys appear in no text, no repr and no error."""

import ipaddress
import os
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

from ...tools.errors import InputError


@dataclass(frozen=True)
class Endpoint:
    """A server and the right to ask it.

    Attributes:
        base_url: without a slash at its end.
        key: None where none is needed or known.
        key_advice: what to do when the server does not accept the key.
    """

    base_url: str
    key: str | None = field(repr=False)
    key_advice: str

    @property
    def is_loopback(self) -> bool:
        """Whether it is this very machine, which no proxy can reach."""
        host = urlsplit(self.base_url).hostname or ""
        try:
            return ipaddress.ip_address(host).is_loopback
        except ValueError:
            return host == "localhost"

    def without_key(self, text: str) -> str:
        """A text with the key struck out: some servers repeat it in their errors."""
        return text.replace(self.key, "[key]") if self.key else text


def endpoint(base_url: str, *variables: str) -> Endpoint:
    """An endpoint with the key that the environment holds for it.

    Args:
        base_url: such as https://api.openai.com/v1.
        variables: environment variables of the key, of which the first that is set counts; the
            one named like it with _FILE names a file that holds it. None for servers that take
            no key.

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
    try:
        parts = urlsplit(base_url)
        usable = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        raise InputError(f"The base URL cannot be read; {advice}.") from None
    if parts.username is not None or parts.password is not None:
        raise InputError("The base URL holds a name or a password; keys come from the environment.")
    if not usable or not base_url.isascii() or not base_url.isprintable() or " " in base_url:
        raise InputError(f"{base_url!r} is no base URL of a server; {advice}.")
    if parts.query or parts.fragment:
        raise InputError(f"{base_url!r} holds more than a path; {advice}.")
    return base_url.rstrip("/")


def _key_from_environment(variable: str) -> str | None:
    key, source = os.environ.get(variable, "").strip(), variable
    path = os.environ.get(f"{variable}_FILE", "")
    if not key and path:
        source = f"the file that {variable}_FILE names"
        try:
            key = Path(path).read_text(encoding="utf-8").strip()
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else "no text"
            raise InputError(
                f"{variable}_FILE names {path}, which cannot be read: {why}."
            ) from None
        if not key:
            raise InputError(f"{variable}_FILE names {path}, which is empty.")
    if not (key.isascii() and key.isprintable()) or " " in key:
        raise InputError(f"The key in {source} holds characters that no key has.")
    return key or None
