"""Tokens: who may do what at a server. Their file has names, scopes and hashes, but no tokens."""

import hashlib
import hmac
import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import from_json, to_json

from ...agent.store.protocol import owner_of
from ...tools.errors import InputError, StorageError
from ...tools.store import read_text, write_whole

Scope = Literal["read", "plan", "move", "approve"]
SCOPES: tuple[Scope, ...] = get_args(Scope)
"""From the least to the most; each includes those before it. Any scope may stop robots.

Whoever may `approve` sees what waits for approval in the sessions of other tokens, and may give it.
"""
_NAME = re.compile(r"[a-z][a-z0-9_]{0,19}")


@dataclass(frozen=True)
class Person:
    """The person who makes a request.

    Attributes:
        name: of their token, with which the ids of their sessions begin; empty if no token is
            needed.
        sees: the one session that they may look at, and do nothing else; None for all their own.
    """

    name: str = ""
    scope: Scope = "move"
    sees: str | None = None

    def may(self, scope: Scope) -> bool:
        """Return whether their scope includes another."""
        return SCOPES.index(self.scope) >= SCOPES.index(scope)


class Entry(BaseModel):
    """A token's entry in the file."""

    name: str
    scope: Scope
    sha256: str
    created: str


class Tokens:
    """The tokens of a server.

    Args:
        path: of their file, reread when it changes; None if the server needs no tokens.
    """

    def __init__(self, path: Path | None) -> None:
        self._path, self._read, self._entries = path, None, tuple[Entry, ...]()

    @property
    def needed(self) -> bool:
        """Whether requests need a token."""
        return self._path is not None

    def person(self, token: str) -> Person | None:
        """Return the owner of a token; None if it is unknown.

        Raises:
            StorageError: the file cannot be read.
        """
        digest = _hash(token)
        found = None
        for entry in self.entries():
            if secrets.compare_digest(entry.sha256, digest):
                found = Person(entry.name, entry.scope)
        return found

    def mark(self, owner: str, what: str) -> str:
        """Return a code that lets its holder look at one thing: an HMAC keyed by a token's hash."""
        keys = [entry.sha256 for entry in self.entries() if entry.name == owner]
        return hmac.new("".join(keys).encode(), what.encode(), hashlib.sha256).hexdigest()

    def share(self, session: str) -> str:
        """Return a code for looking at a session; it is valid as long as its owner's token."""
        return f"{session}.{self.mark(owner_of(session), f'share {session}')}"

    def looking(self, code: str) -> Person | None:
        """Return the person that a code lets look at a session; None if the code is not valid."""
        session = code.rpartition(".")[0]
        if not secrets.compare_digest(code.encode(), self.share(session).encode()):
            return None
        return Person(owner_of(session), "read", session)

    def entries(self) -> tuple[Entry, ...]:
        """Return the entries of all tokens.

        Raises:
            StorageError: the file cannot be read.
        """
        if self._path is None or not self._path.exists():
            return ()
        changed = self._path.stat().st_mtime_ns
        if changed != self._read:
            self._entries, self._read = _parsed(self._path), changed
        return self._entries

    def add(self, name: str, scope: str) -> str:
        """Make a token and return it; it cannot be read back later.

        Raises:
            InputError: the name is taken or not valid, or there is no such scope.
        """
        if not _NAME.fullmatch(name):
            raise InputError(
                f"{name!r} cannot name a token; give up to 20 lowercase letters, digits and "
                "underscores, beginning with a letter."
            )
        if scope not in SCOPES:
            raise InputError(f"A token's scope is one of {', '.join(SCOPES)}, not {scope!r}.")
        if any(entry.name == name for entry in self.entries()):
            raise InputError(f"There is a token {name!r} already; remove it, or give another name.")
        token = f"fu_{secrets.token_urlsafe(32)}"
        made = datetime.now(UTC).isoformat(timespec="seconds")
        entry = Entry(name=name, scope=scope, sha256=_hash(token), created=made)
        self._write((*self.entries(), entry))
        return token

    def remove(self, name: str) -> None:
        """Revoke a token; its sessions stay.

        Raises:
            InputError: there is no token of that name.
        """
        kept = tuple(entry for entry in self.entries() if entry.name != name)
        if len(kept) == len(self.entries()):
            there = ", ".join(entry.name for entry in kept) or "none"
            raise InputError(f"There is no token {name!r}; the tokens are: {there}.")
        self._write(kept)

    def _write(self, entries: Sequence[Entry]) -> None:
        assert self._path is not None
        data = to_json([entry.model_dump() for entry in entries], indent=2)
        write_whole(self._path, data)
        self._path.chmod(0o600)


def _parsed(path: Path) -> tuple[Entry, ...]:
    try:
        return tuple(Entry.model_validate(entry) for entry in from_json(read_text(path)))
    except (ValidationError, ValueError, TypeError):
        raise StorageError(f"{path} is not a token file written by formup tokens.") from None


def _hash(token: str) -> str:
    """Return the hash of a token; as tokens are 256 random bits, a plain hash is enough."""
    return hashlib.sha256(token.encode()).hexdigest()
