"""A contract of the person's own in place of the offline planner's: no words are read.

Where the words differ from the contract, the contract is followed, and the reply says so.
"""

from dataclasses import replace

from ...tools.formation.contract import Contract
from ..first_message import read_task
from ..messages import Call, Reply, Result, User, turn_of
from ..model import Request
from .planner import OfflinePlanner

READING = "The contract is the person's own."


class StatedContract(OfflinePlanner):
    """Proposes a contract about what was pointed at, t1, t2, ..., then goes on like the planner."""

    def __init__(self, contract: Contract) -> None:
        self._contract = contract.model_dump(mode="json", exclude_defaults=True)

    async def reply(self, request: Request) -> Reply:
        """Return the next step of a turn."""
        first, *later = turn_of(request.messages)
        results = [m for m in later if isinstance(m, Result)]
        doubts = [d for m in results if m.cause == "doubt" for d in (m.facts or {})["doubts"]]
        if not results or (doubts and len(results) == 1):
            assert isinstance(first, User)
            contract = self._contract | ({"reading": READING} if doubts else {})
            arguments = {"contract": contract, "targets": read_task(first.text).pointed}
            call = Call(
                id=f"call-{len(results) + 1}", name="propose_formation", arguments=arguments
            )
            return Reply(calls=(call,))
        last = results[-1].model_copy(update={"cause": None})  # else the planner would replan
        reply = await super().reply(replace(request, messages=(*request.messages[:-1], last)))
        if reply.calls or not doubts:
            return reply
        differs = f"The contract was followed where the words differ: {'; '.join(doubts)}."
        return reply.model_copy(update={"text": f"{reply.text} {differs}"})
