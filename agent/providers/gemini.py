"""Google Gemini's generateContent, with the thought signatures it wants back.

A signature belongs to the part it came with, and a signed part must not be joined to another, so a
reply that holds one is stored and sent back part by part.
"""

import re
from functools import lru_cache
from itertools import groupby
from typing import Any
from urllib.parse import quote

from pydantic import BaseModel

from ...tools.tool import Tool
from ..messages import Reply, Result, Usage, User
from ..model import Request
from .calls import CallIds, give_names, read
from .failures import AskError, cut_off, empty, refused, unexpected
from .prices import Price
from .wire import (
    Assembly,
    MessageCache,
    Wire,
    base64_text,
    count,
    described,
    dumped,
    media_type,
    usage_of,
    validated,
)

UNSIGNED = "skip_thought_signature_validator"
"""The signature that Google documents for calls that the model did not make itself."""
_WANTS_SIGNATURES = re.compile(r"(models/)?gemini-(?![12]\b)")
"""Since Gemini 3 the first call of a reply must be signed."""
_CUT_OFF = {"MAX_TOKENS", "CONTINUATION"}
_REFUSED = {
    "BLOCKLIST",
    "ESCALATION",
    "IMAGE_PROHIBITED_CONTENT",
    "IMAGE_RECITATION",
    "IMAGE_SAFETY",
    "LANGUAGE",
    "MODEL_ARMOR",
    "PROHIBITED_CONTENT",
    "PUP_LIMITED_DISABLED",
    "RECITATION",
    "SAFETY",
    "SPII",
}
_KEYS = {"candidates", "promptFeedback", "usageMetadata"}


class _Function(BaseModel):
    id: str | None = None
    name: str | None = None
    args: Any = None


class _Part(BaseModel):
    text: str | None = None
    thought: bool | None = None
    thoughtSignature: str | None = None  # noqa: N815
    functionCall: _Function | None = None  # noqa: N815


class _Content(BaseModel):
    parts: list[_Part] | None = None


class _Candidate(BaseModel):
    content: _Content | None = None
    finishReason: str | None = None  # noqa: N815
    finishMessage: str | None = None  # noqa: N815

    @property
    def parts(self) -> list[_Part]:
        return (self.content.parts if self.content else None) or []

    @property
    def calls(self) -> list[_Function]:
        return [part.functionCall for part in self.parts if part.functionCall is not None]


class _Feedback(BaseModel):
    blockReason: str | None = None  # noqa: N815
    blockReasonMessage: str | None = None  # noqa: N815


class _Response(BaseModel):
    candidates: list[_Candidate] | None = None
    promptFeedback: _Feedback | None = None  # noqa: N815
    usageMetadata: Any = None  # noqa: N815


class _Assembly(Assembly):
    events = "Gemini's contents"

    def __init__(self) -> None:
        self._candidates: dict[int, dict[str, Any]] = {}
        self._whole: dict[str, Any] = {}

    def whole(self) -> Any:
        found = [
            end | {"content": {"parts": _joined(end["content"])}}
            for _, end in sorted(self._candidates.items())
        ]
        return self._whole | ({"candidates": found} if found else {})

    def take(self, event: dict[str, Any]) -> str:
        known = {key: event[key] for key in event.keys() & _KEYS if event[key] is not None}
        if not known:
            raise KeyError
        candidates = known.pop("candidates", None) or ()
        self._whole |= known
        self.done = self.done or bool(known.get("promptFeedback", {}).get("blockReason"))
        return "".join([self._candidate(candidate) for candidate in candidates])

    def _candidate(self, fragment: dict[str, Any]) -> str:
        """Add a fragment and return the text it brings to the first candidate."""
        index = int(fragment.get("index") or 0)
        candidate = self._candidates.setdefault(index, {"content": []})
        ends = {key: fragment.get(key) for key in ("finishReason", "finishMessage")}
        candidate |= {key: value for key, value in ends.items() if value}
        self.done = self.done or bool(candidate.get("finishReason"))
        content: dict[str, Any] = fragment.get("content") or {}
        parts: list[dict[str, Any]] = list(content.get("parts") or ())
        candidate["content"] += parts
        said = [p.get("text") or "" for p in parts if not p.get("thought")]
        return "" if index else "".join(said)


def _joined(parts: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Join runs of plain text parts; signed and other parts stay separate."""
    runs = groupby(parts, key=lambda part: part.keys() == {"text"})
    return [
        part
        for plain, run in runs
        for part in ([{"text": "".join([p["text"] or "" for p in run])}] if plain else run)
    ]


class Gemini(Wire):
    """The wire format of Gemini's generateContent."""

    assembly = _Assembly

    def __init__(self, model: str, price: Price, owner: str = "") -> None:
        self.price, self._ids = price, CallIds(owner or f"gemini:{model}")
        self._resource = quote(model if "/" in model else f"models/{model}")
        self._signs = _WANTS_SIGNATURES.match(model) is not None
        self._turns = MessageCache(self._turn)

    def path(self, *, stream: bool) -> str:
        """Return what follows the base URL."""
        method = "streamGenerateContent?alt=sse" if stream else "generateContent"
        return f"/v1beta/{self._resource}:{method}"

    def headers(self, key: str | None) -> dict[str, str]:
        """Return the key, where there is one; it is not in the URL, since URLs are logged."""
        return {"x-goog-api-key": key} if key else {}

    def body(self, request: Request, *, stream: bool) -> bytes:
        """Return a request as JSON."""
        parts = [b"{"]
        if request.system:
            parts += [b'"systemInstruction":{"parts":[', dumped({"text": request.system}), b"]},"]
        if request.tools:
            parts += [b'"tools":', _function_declarations(request.tools), b","]
        return b"".join([*parts, b'"contents":[', self._contents(request), b"]}"])

    def reply(self, body: Any, request: Request) -> Reply:
        """Return the reply that a complete body holds."""
        response = validated(body, _Response, "content of Gemini's")
        if not response.candidates:
            raise _without_candidates(body, response.promptFeedback)
        candidates = response.candidates
        place = next((n for n, c in enumerate(candidates) if c.calls), 0)
        _check_finish_reason(candidates[place])
        parts, made = candidates[place].parts, candidates[place].calls
        said = "".join(part.text or "" for part in parts if not part.thought)
        text, calls = read(said, [(f.id, f.name or "", f.args) for f in made], request)
        items: tuple[dict[str, Any], ...] = ()
        if len(made) == len(calls) and any(part.thoughtSignature for part in parts):
            items = tuple(body["candidates"][place]["content"]["parts"])
            signed = [i["functionCall"] for i in items if i.get("functionCall") is not None]
            give_names(signed, calls, "id", "args", _function_name)
        usage = _gemini_usage(response.usageMetadata, self.price)
        return Reply(text=text, calls=calls, usage=usage, opaque=self._ids.opaque(calls, items))

    def _contents(self, request: Request) -> bytes:
        """Return messages by turns: all results of one reply share a turn."""
        turns: list[tuple[bytes, list[bytes]]] = []
        before: User | Reply | Result | None = None
        for message in request.messages:
            role, parts = self._turns(message)
            if not parts:
                continue
            if isinstance(message, Result) and isinstance(before, Result):
                turns[-1][1].append(parts)
            else:
                turns.append((role, [parts]))
            before = message
        return b",".join(
            b'{"role":"%b","parts":[%b]}' % (role, b",".join(parts)) for role, parts in turns
        )

    def _turn(self, message: User | Reply | Result) -> tuple[bytes, bytes]:
        """Return a message's role and parts, none if it is empty: empty parts are refused."""
        if isinstance(message, Reply):
            return b"model", b",".join(map(dumped, self._model_parts(message)))
        shown = [_inline_data(image) for image in message.images]
        if isinstance(message, User):
            text = [{"text": message.text}] if message.text.strip() else []
            return b"user", b",".join(map(dumped, [*shown, *text]))
        answer = {
            "id": message.call_id,
            "name": _function_name(message.name),
            "response": {"error" if message.error else "output": message.text},
        }
        # Only some models take images within a functionResponse; all that see take them beside it.
        return b"user", b",".join(map(dumped, [{"functionResponse": answer}, *shown]))

    def _model_parts(self, reply: Reply) -> list[dict[str, Any]]:
        if kept := self._ids.items(reply):
            return list(kept)
        text = [{"text": reply.text}] if reply.text.strip() else []
        calls: list[dict[str, Any]] = [
            {
                "functionCall": {
                    "id": call.id,
                    "name": _function_name(call.name),
                    "args": call.arguments,
                }
            }
            for call in reply.calls
        ]
        if calls and self._signs:
            calls[0]["thoughtSignature"] = UNSIGNED
        return [*text, *calls]


def _without_candidates(data: Any, feedback: _Feedback | None) -> AskError:
    """Return the failure that a body without candidates means."""
    if feedback and feedback.blockReason:
        return refused(feedback.blockReasonMessage or feedback.blockReason)
    if any(data.get(key) is not None for key in _KEYS):
        return empty()
    return unexpected("something that is no content of Gemini's")


def _check_finish_reason(candidate: _Candidate) -> None:
    reason = candidate.finishReason or "STOP"
    if reason in _CUT_OFF:
        raise cut_off()
    if reason in _REFUSED:
        raise refused(candidate.finishMessage or reason)
    if reason not in ("STOP", "FINISH_REASON_UNSPECIFIED"):
        # Mostly MALFORMED_FUNCTION_CALL: the model wrote a call that cannot be read.
        what = f"broke its reply off ({reason})"
        raise AskError(what, "try again, or use another model", "unless-same")


def _gemini_usage(usage: Any, price: Price) -> Usage:
    given = count(usage, "promptTokenCount")
    cached = min(given, count(usage, "cachedContentTokenCount"))
    # Thoughts are billed as output, but not counted among the candidates' tokens.
    output = count(usage, "candidatesTokenCount") + count(usage, "thoughtsTokenCount")
    return usage_of(price, fresh=given - cached, cached=cached, output=output)


def _function_name(name: str) -> str:
    """Return a name that Gemini takes; valid ones stay, as results must name calls exactly."""
    return re.sub(r"[^a-zA-Z0-9_.:-]", "_", name)[:64] or "unnamed"


def _inline_data(image: bytes) -> dict[str, Any]:
    return {"inlineData": {"mimeType": media_type(image), "data": base64_text(image)}}


@lru_cache(maxsize=16)
def _function_declarations(tools: tuple[Tool, ...]) -> bytes:
    return dumped([{"functionDeclarations": described(tools, "parametersJsonSchema")}])
