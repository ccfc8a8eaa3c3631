"""Failures of a model's server: one sentence for each, and whether to ask again."""

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from email.utils import parsedate_to_datetime
from typing import Any, Literal, cast

Again = Literal["never", "unless-same", "later"]
"""never: the request itself is refused; unless-same: retry until it fails the same way twice in a
row, since then nothing will change; later: the server is busy, or the network failed."""
MAX_QUOTED = 300
"""Most characters of a server's own words that are quoted."""
MAX_WAIT = 60.0
"""Seconds; a server that asks for a longer wait is not waited for."""
_LATER = {429, 503, 529}
_UNLESS_SAME = {408, 409, 500, 502, 504}
_STATUS_OF = {
    "authentication_error": 401,
    "invalid_prompt": 400,
    "invalid_request_error": 400,
    "not_found_error": 404,
    "overloaded_error": 529,
    "permission_error": 403,
    "rate_limit_error": 429,
    "rate_limit_exceeded": 429,
    "request_too_large": 413,
}
"""HTTP status by the name of an error that comes without one: in a stream, or under status 200."""


class AskError(Exception):
    """One failed attempt to get a reply.

    Attributes:
        what: what the server did, as the rest of a sentence that begins with its address.
        advice: what to do about it.
        again: whether to ask again.
        wait: seconds the server asks to be left alone, or None.
    """

    def __init__(
        self, what: str, advice: str, again: Again = "never", wait: float | None = None
    ) -> None:
        super().__init__(what)
        if wait is not None and wait > MAX_WAIT and again != "never":
            again, advice = "never", f"it asks to be left alone for {wait:.0f} s; try again then"
        self.what, self.advice, self.again, self.wait = what, advice, again, wait

    def ends(self, before: str | None) -> bool:
        """Return whether to give up, given `what` the failure before was, if there was one."""
        return self.again == "never" or (self.again == "unless-same" and self.what == before)


def of_status(status: int, headers: Mapping[str, str], body: bytes, key_advice: str) -> AskError:
    """Return the failure that an unsuccessful HTTP status means."""
    wait = _retry_after(headers)
    try:
        data = json.loads(body)
        message, code = _message_and_code(data)
        wait = _retry_delay(data) if wait is None else wait
    except ValueError:
        text = body.decode(errors="replace")
        message, code = ("" if text.lstrip().startswith("<") else text), ""
    return _server_failure(f"answered {status}", status, message, code, key_advice, wait)


def of_error_body(data: object, key_advice: str) -> AskError | None:
    """Return the failure in a body that came as a success or within a stream, or None."""
    if not isinstance(data, dict) or not cast("dict[str, Any]", data).get("error"):
        return None
    message, code = _message_and_code(cast("dict[str, Any]", data))
    is_status = len(code) == 3 and code.isascii() and code.isdecimal()
    status = int(code) if is_status else _STATUS_OF.get(code, 500)
    return _server_failure("answered with an error", status, message, code, key_advice, None)


def cut_off(limit: int | None = None) -> AskError:
    """Return the failure of a reply cut off at the length limit: none of it may be acted on."""
    bound = "its limit of length" if limit is None else f"the limit of {limit:,} tokens"
    return AskError(f"cut its reply off at {bound}", "ask for less at once, or use another model")


def refused(words: str) -> AskError:
    """Return the failure of a model that refused to answer."""
    return AskError(f"refused{_quoted(words)}", "say it another way, or use another model")


def empty() -> AskError:
    """Return the failure of a reply with neither text nor a call."""
    return AskError("gave an empty reply", "try again, or use another model", "unless-same")


def unexpected(what: str) -> AskError:
    """Return the failure of an answer that is not what the API promises."""
    return AskError(
        f"answered with {what}", "is the base URL right? It usually ends in /v1", "unless-same"
    )


def _server_failure(
    verb: str, status: int, message: str, code: str, key_advice: str, wait: float | None
) -> AskError:
    what = f"{verb}{_quoted(message)}"
    if code == "insufficient_quota" or status == 402:
        return AskError(what, "the account is used up: see to its plan and billing")
    again: Again = "never"
    if status in _LATER:
        again = "later"
    elif status in _UNLESS_SAME or status > 504:
        again = "unless-same"
    return AskError(what, _advice(status, key_advice), again, wait)


def _advice(status: int, key_advice: str) -> str:
    if status in (401, 403):
        return key_advice
    known = {
        404: "are the model's name and the base URL right? The URL usually ends in /v1",
        413: "the conversation is too large for it; point at the thing, or start anew",
        429: "wait, or use another model",
    }
    if status in known:
        return known[status]
    if status < 400:
        return "it has moved: mend the base URL"
    return "try again later" if status >= 500 else "it does not take such a request"


def _message_and_code(data: object) -> tuple[str, str]:
    """Return the message and code of an error body in any of the usual shapes."""
    data = _unwrapped(data)
    if not isinstance(data, dict):
        return (data, "") if isinstance(data, str) else ("", "")
    whole = cast("dict[str, Any]", data)
    error = whole.get("error") or whole
    if not isinstance(error, dict):
        return str(error), ""
    fields = cast("dict[str, Any]", error)
    message = fields.get("message") or fields.get("detail") or ""
    text = message if isinstance(message, str) else json.dumps(message)
    return text, str(fields.get("code") or fields.get("type") or "")


def _quoted(words: str) -> str:
    """Return a server's words in brackets, as one printable line of limited length."""
    line = " ".join("".join(c if c.isprintable() else " " for c in words).split())
    shown = line.rstrip(".") if len(line) <= MAX_QUOTED else line[: MAX_QUOTED - 3] + "..."
    return f" ({shown})" if shown else ""


def _unwrapped(data: object) -> object:
    """Unwrap a list of one object, in which Gemini sends errors when a stream was asked for."""
    listed = cast("list[Any]", data) if isinstance(data, list) else []
    alone = len(listed) == 1 and isinstance(listed[0], dict)
    return cast("object", listed[0] if alone else data)


def _retry_delay(data: object) -> float | None:
    """Return the seconds to wait that Gemini gives in an error's details, or None."""
    try:
        details = cast("Any", _unwrapped(data))["error"]["details"]
        delays = [detail["retryDelay"] for detail in details if "retryDelay" in detail]
        return max(0.0, float(delays[0].removesuffix("s")))
    except (TypeError, KeyError, IndexError, AttributeError, ValueError):
        return None


def _retry_after(headers: Mapping[str, str]) -> float | None:
    """Return the seconds of a Retry-After header, in either of its forms, or None."""
    given = headers.get("retry-after", "")
    try:
        seconds = float(given)
    except ValueError:
        try:
            date = parsedate_to_datetime(given)
        except ValueError:
            return None
        known = date if date.tzinfo else date.replace(tzinfo=UTC)
        seconds = (known - datetime.now(UTC)).total_seconds()
    return max(0.0, seconds) if math.isfinite(seconds) else None
