"""No robots move on words alone while a question is open: what it is about would be lost."""

from ..tools.errors import InputError
from .outcomes import Paused


def check_settled(outcome: Paused, kind: str) -> None:
    """Refuse to move robots while a question is open.

    Args:
        outcome: of the turn that waits.
        kind: what the next words are, as in `Followup`.

    Raises:
        InputError: they are a go, and what was asked about would be dropped (`asked`).
    """
    if kind == "go" and outcome.call.name == "ask_user":
        raise InputError(
            "A question is open, so nothing moves. Answer it, or say never mind to drop it; then "
            f"say go. It was: {outcome.call.arguments['question']}",
            "asked",
        )
