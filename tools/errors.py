"""Every exception formup raises on purpose, by who has to act. Code reads `kind` and `facts`.

FormupError
│   the model corrects its call and goes on:
├── ToolError      a tool cannot do what it was asked for
│   └── ArgumentsError the arguments are against the tool's schema
│   the person changes what was given:
├── InputError     something that cannot be used; the text says what would do
│   ├── ImageError     the picture file: missing, broken, too large, of a foreign format
│   ├── StorageError   a log, state or artefact that cannot be read or written
│   └── ApprovalError  a plan waits for a person's approval before real robots move
│   the turn halts:
├── ModelError     a model or its provider failed, or does not exist
└── FleetError     robots could not be moved or observed
"""

from typing import Any, Literal

Kind = Literal[
    "capacity",
    "cage",
    "crowded",
    "no_room_beside",
    "low_confidence",
    "count",
    "doubt",
    "edit",
    "no_order",
    "nothing_to_undo",
    "unknown_target",
    "unknown_plan",
    "void_plan",
    "too_many_robots",
    "missing",
    "busy",
    "gone_on",
    "key",
    "repeated",
    "approval",
    "not_allowed",
    "asked",
    "too_large",
    "too_many",
]
"""capacity: more robots than fit (`robots_that_fit`); cage: none that is escape-proof
(`robots_that_fit`, `robots_needed`); crowded: two groups in each other's way (`groups`, from 1);
each may have `partial_plan`, the id of a plan certified for less. no_room_beside: a form has no
room on that side of a target; low_confidence: no mask that is sure enough (`confidence`,
`threshold`); count: another number of robots than the person gave; unknown_target, unknown_plan:
no such id; void_plan: the world has changed since; too_many_robots: more than can be driven;
doubt: a contract that does not seem to be what the words say (`doubts`, each a clause); edit: the
plan after a change is not certified (`findings`, each a sentence); no_order: robots that keep their
places stand in each other's way; nothing_to_undo: there is no step back, or none taken back;
missing, busy, gone_on: a session that is not in its store, is written by another process, or was
written since it was opened; key, repeated: a turn was asked for under a key before, with other
arguments or the same (`turn`, its number); approval: a yes to something that does not wait for
one; not_allowed: whoever asks may not do that; asked: a question is open; too_large, too_many:
more than a server takes."""


class FormupError(Exception):
    """Base of all errors whose message is meant to be read by a person or a model.

    Args:
        message: one sentence or more.
        kind: what went wrong, where code reacts to it.
        facts: its numbers and ids, values of JSON. `plain` is the message for a person where
            the message itself speaks to a model, of arguments or of what to call next.

    Attributes:
        kind, facts: as given.
    """

    def __init__(self, message: str, kind: Kind | None = None, **facts: Any) -> None:
        super().__init__(message)
        self.kind: Kind | None = kind
        self.facts = facts


class InputError(FormupError):
    """Bad input from a person: the message names the value, what is allowed, what to do."""


class ImageError(InputError):
    """A picture that cannot be loaded safely."""


class StorageError(InputError):
    """A log, a state file or an artefact that cannot be read or written."""


class ApprovalError(InputError):
    """Real robots wait for a person's approval of exactly this plan.

    Attributes:
        plan_id: of the plan.
    """

    def __init__(self, plan_id: str) -> None:
        super().__init__(f"Plan {plan_id} moves real robots and waits for a person's approval.")
        self.plan_id = plan_id


class ToolError(FormupError):
    """A tool cannot do what its arguments ask; the model is told why and may correct them.

    Attributes:
        images: PNG or JPEG files that show why, for models that see.
    """

    images: tuple[bytes, ...] = ()

    def showing(self, *images: bytes) -> "ToolError":
        """Return the same error with pictures."""
        self.images = images
        return self


class ArgumentsError(ToolError):
    """Arguments against the tool's schema; the text names every violation."""


class ModelError(FormupError):
    """A model, or the service behind it, could not answer."""


class FleetError(FormupError):
    """The fleet could not be reached, moved or observed."""
