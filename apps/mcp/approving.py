"""A person's yes to exactly one plan, asked for through the client where that is possible.

The call is tried before anybody is asked, so that a plan which cannot be driven troubles nobody.
The nonce that a yes has to name never leaves the server.
"""

from mcp.server.mcpserver import Elicit
from pydantic import BaseModel, Field

from ..server.hub import asked_by, need
from .access import Ctx, caller, theirs, told
from .state import followed, planned

NO_FORM = (
    "This client cannot ask a person. Let one approve the plan elsewhere: in formup chat "
    "--session {session} with /approve, or with POST /api/sessions/{session}/approvals; then ask "
    "status. "
)


class Yes(BaseModel):
    """A person's answer."""

    approve: bool = Field(description="Yes: the real robots drive to exactly this plan, now")


def key_of_yes(idempotency_key: str) -> str:
    """The key of the turn that follows a person's answer to a call."""
    return f"{idempotency_key}/answer"


@told
async def ask_person(
    ctx: Ctx, session: str, plan_id: str, idempotency_key: str
) -> Elicit[Yes] | str:
    """Begin to drive; where a person has to say yes first, ask them.

    Returns:
        The question, or what is told before how the session stands, where nobody is asked.
    """
    hub, person = caller(ctx)
    need(person, "move")
    planned(await theirs(ctx, session), plan_id)
    service, now = hub.service, hub.service.turn(session)
    if now is not None and now.asked.key == key_of_yes(idempotency_key):
        return await followed(ctx, now)
    waits = None if now is not None else await service.waits(session)
    if waits is None or waits.plan_id != plan_id:
        before = await followed(
            ctx, service.go(session, plan_id, asked=asked_by(person, idempotency_key))
        )
        waits = None if before else await service.waits(session)
        if waits is None or waits.plan_id != plan_id:
            return before
    return Elicit(waits.message, Yes) if _can_ask(ctx) else NO_FORM.format(session=session)


def _can_ask(ctx: Ctx) -> bool:
    """Whether the client shows forms to a person; one that names no kind shows forms."""
    declared = ctx.client_capabilities
    offers = None if declared is None else declared.elicitation
    return offers is not None and (offers.form is not None or offers.url is None)
