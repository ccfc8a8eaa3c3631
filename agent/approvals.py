"""A person's yes to exactly one call, given from outside the turn that waits for it.

Whoever is shown what waits is given a nonce, which no model sees. It is stored as a file of the
session, so that any process can check it; it is void as soon as the session has gone on.
"""

import hashlib
import secrets
from dataclasses import dataclass

from pydantic_core import to_json

from ..tools.errors import InputError
from .outcomes import Paused
from .session import Run


@dataclass(frozen=True)
class Waiting:
    """A call that waits for a person's yes.

    Attributes:
        plan_id: the plan it is for; None where it moves nothing.
        nonce: what the yes has to quote.
        message: what the person is asked.
    """

    plan_id: str | None
    nonce: str
    message: str


def waiting(run: Run | None) -> Waiting | None:
    """Return the call that waits for a yes, with a new nonce, or None."""
    if not is_waiting(run) or run is None or run.stored is None:
        return None
    nonce = secrets.token_urlsafe(16)
    outcome = run.outcome
    assert isinstance(outcome, Paused)
    run.stored.artefacts.put(_content(run, nonce))
    return Waiting(outcome.plan_id, nonce, run.report.message)


def check_nonce(run: Run | None, plan_id: str, nonce: str) -> None:
    """Refuse a yes to anything but the call that waits now.

    Raises:
        InputError: nothing waits, another plan does, or the nonce is not one for it (`approval`).
    """
    if not is_waiting(run) or run is None or run.stored is None:
        raise InputError(f"{plan_id} cannot be approved: no plan waits for approval.", "approval")
    outcome = run.outcome
    assert isinstance(outcome, Paused)
    if outcome.plan_id != plan_id:
        raise InputError(f"{plan_id} cannot be approved: plan {outcome.plan_id} waits.", "approval")
    if hashlib.sha256(_content(run, nonce)).hexdigest() not in run.stored.artefacts:
        raise InputError(
            f"This approval of {plan_id} is not valid, or no longer: look at what waits now, and "
            "approve that.",
            "approval",
        )


def is_waiting(run: Run | None) -> bool:
    """Return whether a call waits for a person's yes."""
    outcome = None if run is None else run.outcome
    return isinstance(outcome, Paused) and outcome.call.name != "ask_user"


def _content(run: Run, nonce: str) -> bytes:
    """Return what a yes is bound to: the session so far, the plan, the exact call, the nonce."""
    outcome = run.outcome
    assert isinstance(outcome, Paused) and run.stored is not None
    call = outcome.call
    return to_json(
        ["approval", run.stored.id, run.events, outcome.plan_id, call.name, call.arguments, nonce]
    )
