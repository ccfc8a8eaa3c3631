"""One line of a chat, words or a command: the service acts, files are written, a report is made.

Every front end of a chat, for a person or a program, shows the result.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from typing import Any

from ..agent.agent import Agent
from ..agent.outcomes import Answered
from ..agent.report import Report, Status, Totals
from ..agent.service import Service
from ..agent.session import Run, Show
from ..agent.stopping import is_stop
from ..tools.context import Context, View, unseen
from ..tools.errors import StorageError
from ..tools.formation.plan import Plan
from .chat_commands import COMMANDS, command_named
from .run_files import Folder, write_turn


@dataclass(frozen=True)
class Shown:
    """The result of a line.

    Attributes:
        turn: number of the line in this chat, from 1.
        run: the session's run after the line; its report is on this line and names its files.
        before: the plan to compare the current one with: the one before the turn, or its parent
            for a command that draws; None if the plan did not change, or the picture did.
        changed: whether the report is of another plan than the one before.
        ends: whether the chat is over.
    """

    turn: int
    run: Run
    before: Plan | None = None
    changed: bool = False
    ends: bool = False

    @property
    def report(self) -> Report:
        """The report on the line."""
        return self.run.report


class Talk:
    """A chat in one session at a time.

    Args:
        folder: where plans and pictures are written.
        agent_named: makes the agent with another model.
        view: shows robots as they drive.
    """

    session = ""

    def __init__(
        self,
        service: Service,
        folder: Folder,
        agent_named: Callable[[str], AbstractContextManager[Agent]],
        view: View = unseen,
    ) -> None:
        self.service, self.folder, self.agent_named = service, folder, agent_named
        self._view = view
        self.agents = ExitStack()
        self._turn = 0

    @property
    def run(self) -> Run:
        """The session's current run; before anything was said, a blank one with an empty world."""
        held = self.service.session(self.session)
        if held.run is not None:
            return held.run
        context = Context.of(held.picture, held.settings)
        image = context.world.picture.model_dump()
        model = held.agent.model.name
        blank = Report(status="answered", message="", instruction="", image=image, model=model)
        return Run(blank, Answered((), context.world, ""), context, context.world)

    async def line(self, text: str, show: Show | None = None) -> Shown:
        """Carry out a line: a command if it begins with a slash, else words for the agent.

        Raises:
            InputError: the line cannot be carried out; nothing was done.
        """
        before, services = self.run, self.service.session(self.session).services
        if services is not None:
            services.view = self._view
        command = command_named(text) if text.startswith("/") else None
        if command is None:
            done = await self.service.say(self.session, text, show=show)
        else:
            done = await command.do(self, text.partition(" ")[2].strip(), show)
        self._turn += 1
        if isinstance(done, Run):
            return self._shown(before, done)
        now = replace(self.run, report=self._unchanged_report(text, done or "Bye."))
        drawn = command is not None and command.draws
        return self._finished(
            now, self._parent(now) if drawn else None, drawn=drawn, ends=done is None
        )

    async def stop(self) -> None:
        """Stop the turn and the robots."""
        await self.service.stop(self.session)

    def is_stop(self, text: str) -> bool:
        """Return whether a line typed while a turn runs says to stop."""
        return is_stop(text, driving=True)

    def refused(self, text: str, message: str, status: Status) -> Shown:
        """Return the result of a line that was not carried out, with that message."""
        self._turn += 1
        report = self._unchanged_report(text, message).model_copy(update={"status": status})
        return Shown(self._turn, replace(self.run, report=report))

    def words(self) -> list[str]:
        """Return the words offered for completion: commands, and ids of things and plans."""
        world = self.run.world
        things = [thing.id for thing in (*world.targets, *world.keep_out, *world.shown)]
        return [f"/{name}" for name in COMMANDS] + things + list(world.plans)

    def _shown(self, before: Run, run: Run) -> Shown:
        """Return the result of a turn, and write its files."""
        was, now = before.world.plans.get(before.world.current or ""), run.report
        changed = now.plan_id not in (None, before.report.plan_id)
        other = run.world.picture != before.world.picture
        plan = None if was is None or was.plan.id == now.plan_id or other else was.plan
        drawn = changed or bool(now.arrival or now.candidates or run.world.doubted)
        return self._finished(run, plan, drawn=drawn, changed=changed)

    def _finished(
        self,
        run: Run,
        before: Plan | None,
        *,
        drawn: bool,
        changed: bool = False,
        ends: bool = False,
    ) -> Shown:
        said: dict[str, Any] = {"files": None}
        try:
            said["files"] = write_turn(self.folder, self._turn, run, before) if drawn else None
        except StorageError as error:  # still report what was done
            said["message"] = f"{run.report.message} Files are missing: {error}"
        run = replace(run, report=run.report.model_copy(update=said))
        return Shown(self._turn, run, before, changed, ends)

    def _parent(self, run: Run) -> Plan | None:
        """Return the plan that the current one was made from, or None."""
        plans = run.world.plans
        node = plans.get(run.world.current or "")
        parent = plans.get((node and node.parent) or "")
        return parent and parent.plan

    def _unchanged_report(self, text: str, message: str) -> Report:
        """Return the report on a line that changed nothing."""
        same = {"candidates": None, "arrival": None, "usage": Totals(), "files": None}
        said = {"status": "answered", "message": message, "instruction": text}
        return self.run.report.model_copy(update={**same, **said})
