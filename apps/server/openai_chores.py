"""Chores, which chat programs ask of the model for themselves: titles, tags, search queries.

Taken for a person's words, these would be orders to robots. They are recognized by several signs
and answered here, without a turn, a tool, or a look at any session.
"""

import re
import textwrap

from pydantic_core import to_json

from .openai_request import ChatRequest

TASK = re.compile(r"\w+_generation|function_calling")
"""The names that Open WebUI gives to chores, where it names them."""
KNOWN = re.compile(
    r"\s*#+ *\**task\b|.*<chat_history>"
    r"|.*return the correct tool\(s\) from the list of available tools"
    r"|your task is to reflect the speaker's likely facial expression"
    r"|you have been provided with a set of responses from various models",
    re.I | re.S,
)
SIGNS = (
    re.compile(r"\b(title|name|tags?|summar\w+|follow.?ups?|suggest\w*|quer(y|ies)|emoji)\b", re.I),
    re.compile(r"\b(conversation|chat|discussion|dialog(ue)?)\b", re.I),
    re.compile(
        r"\bjson\b|\bonly (the|return|reply|respond|output)\b|\b(return|reply|output) only\b"
        r"|\bwords?.or.(less|fewer)\b|\bno punctuation\b|\bwithout (any )?(lead-in|punct|quot)"
        r"|\bmax(imum)?( of)? \d+",
        re.I,
    ),
)
"""What is wanted, about what, in which form: only all three signs together make a chore."""
HEAD = 400
"""Characters of a system message to search for signs; long messages mention everything."""
SUGGESTIONS = ("A bit further out", "How far apart are the robots?", "Undo")
KINDS: tuple[tuple[str, str, object], ...] = (
    (r"tool_calls|function_calling", "tool_calls", ()),
    (r"autocomplet", "text", ""),
    (r"follow.?up|suggest", "follow_ups", SUGGESTIONS),
    (r"\btags?\b|tags_", "tags", ("Robotics", "Formation")),
    (r"search quer|query_", "queries", ()),
    (r"\bimage generation\b|image_prompt", "prompt", ""),
)
"""For each kind of chore, its pattern, and the name and value that it is answered with."""
TITLE = re.compile(r"\b(title|name)\b|title_", re.I)
SPOKEN = re.compile(r"^\W*(?:user|human)\W*?: *(\S.*)$", re.I | re.M)
HISTORY = re.compile(r"<chat_history>|^\W*(?:user|human)\W*?:", re.I | re.M)
NOTHING = (
    "That looks like a request of the chat program, not of a person, so nothing was done; "
    "rephrase it if it was meant for the robots."
)


def chore(request: ChatRequest) -> str | None:
    """Return the answer to a chore; None if the message is a person's."""
    text, system = request.last.text, request.system
    prompt = text if _is_chore(text, None) else system if _is_chore(system, HEAD) else ""
    if not prompt and not TASK.fullmatch(request.task):
        return None
    asked = HISTORY.split(f"{request.task}\n{prompt or text}", maxsplit=1)[0]
    for pattern, name, value in KINDS:
        if re.search(pattern, asked, re.I):
            return to_json({name: value}).decode()
    as_json = request.as_json or "json" in asked.lower()
    if TITLE.search(asked):
        title = _title(request)
        return to_json({"title": title, "language": "English"}).decode() if as_json else title
    if "emoji" in asked.lower():
        return "🤖"
    return "{}" if as_json else NOTHING


def _is_chore(text: str, head: int | None) -> bool:
    """Return whether a text is a chore, by known wording or by all signs within its head."""
    return bool(KNOWN.match(text)) or all(sign.search(text[:head]) for sign in SIGNS)


def _title(request: ChatRequest) -> str:
    """Return a title made from the person's first message."""
    quoted = SPOKEN.search(request.last.text)
    first = quoted[1] if quoted else request.users[0].text if len(request.users) > 1 else ""
    return textwrap.shorten(first, 50, placeholder="…") or "Robots"
