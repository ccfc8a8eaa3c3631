"""One line of a chat, said or commanded: the service does it, files are written, a report is made.

Whatever shows a chat, to a person or a program, shows this.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, replace
from typing import Any

from ..agent.agent import Agent
from ..agent.conversation import is_stop
from ..agent.outcomes import Answered
from ..agent.report import Report, Totals
from ..agent.service import Service
from ..agent.session import Run, Show
from ..tools.context import Context, View, unseen
from ..tools.errors import StorageError
from ..tools.formation.plan import Plan
from .chat_commands import COMMANDS, command_named
from .run_files import Folder, write_turn


@dataclass(frozen=True)
class Shown:
    """What came of a line.

    Attributes:
        turn: its number in this chat, from 1.
        run: the session as it then stands; its report is of this line, with the names of files.
        before: the plan that stood before, where it is another than now.
        changed: whether another plan stands now.
        ends: whether the chat is over.
    """

    turn: int
    run: Run
    before: Plan | None = None
    changed: bool = False
    ends: bool = False

    @property
    def report(self) -> Report:
        """What came of the line."""
        return self.run.report


class Talk:
    """A chat in one session at a time.

    Args:
        folder: for plans and pictures.
        agent_named: the agent with another model.
        view: shows robots that drive.
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
        """The session as it stands; before anything was said, with an empty world."""
        held = self.service.session(self.session)
        if held.run is not None:
            return held.run
        context = Context.of(held.picture, held.settings)
        image = context.world.picture.model_dump()
        model = held.agent.model.name
        blank = Report(status="answered", message="", instruction="", image=image, model=model)
        return Run(blank, Answered((), context.world, ""), context, context.world)

    async def line(self, text: str, show: Show | None = None) -> Shown:
        """Do what a line says.

        Raises:
            InputError: it cannot be done; nothing was.
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
        now = replace(self.run, report=self._told(text, done or "Bye."))
        drawn = command is not None and command.draws
        return self._finished(
            now, self._parent(now) if drawn else None, drawn=drawn, ends=done is None
        )

    async def stop(self) -> None:
        """Stop the turn and the robots."""
        await self.service.stop(self.session)

    def is_stop(self, text: str) -> bool:
        """Whether a line, typed while a turn runs, says to stop."""
        return is_stop(text, driving=True)

    def failed(self, text: str, message: str) -> Shown:
        """What there is to show of a line that could not be done."""
        self._turn += 1
        report = self._told(text, message).model_copy(update={"status": "failed"})
        return Shown(self._turn, replace(self.run, report=report))

    def words(self) -> list[str]:
        """What can be completed."""
        world = self.run.world
        things = [thing.id for thing in (*world.targets, *world.keep_out, *world.shown)]
        return [f"/{name}" for name in COMMANDS] + things + list(world.plans)

    def _shown(self, before: Run, run: Run) -> Shown:
        """What a turn did, with its files."""
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
        except StorageError as error:  # what was done is what has to be told
            said["message"] = f"{run.report.message} Files are missing: {error}"
        run = replace(run, report=run.report.model_copy(update=said))
        return Shown(self._turn, run, before, changed, ends)

    def _parent(self, run: Run) -> Plan | None:
        """The plan that the one that stands was made from."""
        plans = run.world.plans
        node = plans.get(run.world.current or "")
        parent = plans.get((node and node.parent) or "")
        return parent and parent.plan

    def _told(self, text: str, message: str) -> Report:
        """A report that changed nothing."""
        same = {"candidates": None, "arrival": None, "usage": Totals(), "files": None}
        said = {"status": "answered", "message": message, "instruction": text}
        return self.run.report.model_copy(update={**same, **said})
