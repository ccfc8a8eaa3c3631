"""A run at the command line: shows it, writes its files, passes the person's answers to it."""

from pathlib import Path

from rich.console import Console

from ..agent.agent import Agent
from ..agent.outcomes import Answered, Cancelled
from ..agent.report import Report
from ..agent.session import Run
from ..tools.errors import InputError
from ..tools.store import write_whole
from .main import INTERRUPTED
from .run_display import ask, at_terminal, deploy_command, show_report
from .run_files import Folder, write_files
from .terminal import say

MOST_ANSWERS = 5
"""Most questions that one run asks at a terminal."""


class TerminalSession:
    """The front end of a run at a terminal.

    Args:
        agent: goes on with the run.
        folder: for its files.
        as_json: whether a program reads the output; it is not asked anything.
        record: a file for a copy of the trace, if wanted.
        film: a file for a film of the robots, if wanted.
    """

    def __init__(
        self,
        agent: Agent,
        folder: Folder,
        as_json: bool,
        record: Path | None = None,
        film: Path | None = None,
    ) -> None:
        self._agent, self._folder, self._as_json = agent, folder, as_json
        self._record, self._film = record, film

    @property
    def can_ask(self) -> bool:
        """Whether a person is there to answer."""
        return not self._as_json and at_terminal()

    def serve(self, run: Run) -> int:
        """Show a run's report, and go on with the run as long as a person answers.

        Returns:
            The exit code.
        """
        report = self._show(run)
        for _ in range(MOST_ANSWERS if self.can_ask else 0):
            if report.status not in ("question", "needs_approval"):
                break
            asked = report.status == "question"
            text = ask("your answer" if asked else "yes, or no and the reason")
            if not text:
                break
            approve = None if asked else text.lower() in ("y", "yes")
            run = self._agent.resume(run, answer=text, approve=approve)
            report = self._show(run)
        return INTERRUPTED if isinstance(run.outcome, Cancelled) else report.exit_code

    def _show(self, run: Run) -> Report:
        report = run.report
        try:
            report = report.model_copy(update={"files": write_files(self._folder, run, self._film)})
            if self._record is not None and run.trace:
                write_whole(self._record, run.trace.read_bytes())
        except InputError as error:
            if report.arrival is None:
                raise
            # Robots have moved, which must be reported even if the files cannot be written.
            text = f"{report.message} Files are missing: {error}"
            report = report.model_copy(update={"message": text})
        if self._as_json:
            say(report.model_dump_json(indent=2))
            say(f"formup: files in {self._folder.path}", error=True)
        else:
            plan, fleet = self._folder.path / "plan.json", run.context.settings.fleet
            again = deploy_command(plan, fleet) if isinstance(run.outcome, Answered) else None
            show_report(Console(highlight=False), report, str(self._folder.path), again)
        return report
