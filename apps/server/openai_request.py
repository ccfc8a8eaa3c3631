"""The request of a chat client, in either of OpenAI's two formats, as one value.

The person's last message is carried out; the rest of the history only shows where it belongs.
Messages of systems, tools and assistants are never obeyed.
"""

import base64
import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, Field
from pydantic_core import PydanticSerializationError, to_json

from ...tools.errors import InputError

OURS = re.compile(r"/v1/pictures/([a-z0-9_-]+)/(\d+)")
"""Finds the session and turn in the address that each of our messages ends with."""
DATA = re.compile(r"data:image/[\w.+-]+;base64,", re.I)
RESPONSE = re.compile(r"resp_(?:none_[0-9a-f]+|([a-z0-9_-]+)_(\d+))")


@dataclass(frozen=True)
class Place:
    """The turn that one of our messages answers.

    Attributes:
        turn: number of the event that began it; 0 for the session's current end.
    """

    session: str
    turn: int

    @property
    def path(self) -> str:
        """The path by which our messages refer to this place."""
        return f"/v1/pictures/{self.session}/{self.turn}"


class Part(BaseModel):
    """A part of a message."""

    type: str = "text"
    text: str | None = None
    image_url: str | dict[str, Any] | None = None


class Message(BaseModel):
    """A message, or an item of a history that has no role."""

    role: str = ""
    content: str | list[Part] | None = None

    @property
    def text(self) -> str:
        """The text of its parts."""
        parts = self.content or ""
        said = parts if isinstance(parts, str) else "\n".join(p.text for p in parts if p.text)
        return said.strip()

    @property
    def pictures(self) -> tuple[str, ...]:
        """Addresses of its pictures, "" for one without an address, such as a file's id."""
        return tuple(
            str(p.image_url.get("url", "") if isinstance(p.image_url, dict) else p.image_url or "")
            for p in self._parts
            if p.type in ("image_url", "input_image")
        )

    @property
    def others(self) -> tuple[str, ...]:
        """The types of its parts that are neither text nor a picture."""
        known = ("text", "input_text", "image_url", "input_image")
        return tuple(p.type for p in self._parts if p.type not in known)

    @property
    def _parts(self) -> Sequence[Part]:
        return self.content if isinstance(self.content, list) else ()


class Body(BaseModel):
    """The fields used from both formats; any others are ignored."""

    model: str = Field(min_length=1, max_length=200)
    stream: bool | None = None
    n: int | None = None
    modalities: list[str] | None = None
    audio: dict[str, Any] | None = None
    metadata: dict[str, Any] | None = None
    response_format: dict[str, Any] | None = None
    user: str | None = None


class ChatBody(Body):
    """The body of a chat completion."""

    messages: list[Message] = Field(min_length=1)
    stream_options: dict[str, Any] | None = None


class ResponsesBody(Body):
    """The body of a response."""

    input: str | list[Message]
    previous_response_id: str | None = None

    @property
    def messages(self) -> list[Message]:
        """The input as messages."""
        said = self.input
        return [Message(role="user", content=said)] if isinstance(said, str) else said


@dataclass(frozen=True)
class ChatRequest:
    """The request of a chat client: what the person said, and where in which conversation.

    Attributes:
        model: name of the model that is to decide.
        users: the person's messages, oldest first.
        since: those after `place`.
        place: of our last message in the history, or of the response or session the client names.
        chat: the client's id of the conversation; empty if it gives none.
        who: distinguishes the people behind one token.
        system: the client's own instructions, by which chores are recognized.
        task: the chore, if the client names it; else empty.
        as_json: whether JSON is wanted.
    """

    model: str
    users: tuple[Message, ...]
    since: tuple[Message, ...]
    place: Place | None
    chat: str
    who: str
    system: str
    task: str
    as_json: bool

    @property
    def last(self) -> Message:
        """The message to carry out."""
        return self.users[-1]


def parse_request(body: ChatBody | ResponsesBody, headers: Mapping[str, str]) -> ChatRequest:
    """Return what a request says.

    Raises:
        InputError: something in it is not supported, or it has no message of a person.
    """
    _check(body)
    messages, place, after = body.messages, None, 0
    for number, message in enumerate(messages):
        if message.role == "assistant" and (found := OURS.findall(message.text)):
            place, after = Place(found[-1][0], int(found[-1][1])), number
    if isinstance(body, ResponsesBody) and body.previous_response_id is not None:
        place, after = place_of(body.previous_response_id), 0
    if place is None and (session := headers.get("x-formup-session")):
        place = Place(session, 0)
    users = tuple(m for m in messages if m.role == "user")
    if not users:
        raise InputError(
            "The request has no message of role user; add one with what the person says."
        )
    facts = {k: str(v) for k, v in (body.metadata or {}).items()}
    chat = facts.get("chat_id") or facts.get("conversation_id")
    return ChatRequest(
        model=body.model,
        users=users,
        since=tuple(m for m in messages[after:] if m.role == "user"),
        place=place,
        chat=chat or headers.get("x-openwebui-chat-id", ""),
        who=f"{body.user or ''} {headers.get('x-openwebui-user-id', '')}",
        system="\n".join(m.text for m in messages if m.role in ("system", "developer")),
        task=facts.get("task", ""),
        as_json="json" in str((body.response_format or {}).get("type")),
    )


def place_of(response: str) -> Place | None:
    """Return the place of a response, given its id; None for one that answers no turn.

    Raises:
        InputError: the id is not one of ours (`missing`).
    """
    found = RESPONSE.fullmatch(response)
    if found is None:
        raise InputError(f"There is no response {response[:80]!r}.", "missing")
    return None if found[1] is None else Place(found[1], int(found[2]))


def data_of(address: str) -> bytes:
    """Return the bytes of a picture's data URL; nothing is ever fetched.

    Raises:
        InputError: the address is not a data URL of a picture.
    """
    head = DATA.match(address)
    if head is None:
        shown = address[:60] or "a file's id"
        raise InputError(
            f"The picture is given as {shown!r}, but this server fetches nothing; attach the file "
            "itself, as a data URL (data:image/png;base64,...)."
        )
    try:
        return base64.b64decode(address[head.end() :], validate=True)
    except ValueError:
        raise InputError(
            "The picture's data URL is not valid base64; attach the picture again."
        ) from None


def digest(*parts: object) -> str:
    """Return a hash by which the same request is recognized; 32 hexadecimal digits.

    Raises:
        InputError: a part is not valid text.
    """
    given = [p.model_dump() if isinstance(p, Message) else p for p in parts]
    try:
        return hashlib.sha256(to_json(given)).hexdigest()[:32]
    except PydanticSerializationError:
        raise InputError("Parts of the request are not valid text; leave them out.") from None


def _check(body: Body) -> None:
    """Refuse options that would otherwise be silently ignored."""
    if (body.n or 1) > 1:
        raise InputError(
            f"n is {body.n}; only one answer per message is supported: leave out n, or set 1."
        )
    if body.audio or "audio" in (body.modalities or ()):
        raise InputError("Audio answers are not supported; ask for text only.")
