"""Check whether a comparison allows one version of a prompt to replace another.

A report of `formup eval compare` names the two texts it is about; it says nothing about others.
"""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from ...prompts import Prompt
from ...tools.errors import InputError
from ...tools.store import parse_json, read_text
from ...tools.tool import violations


class Side(BaseModel):
    """One of the two compared: its prompt, the hash of its text, the part it was tried without."""

    model_config = ConfigDict(frozen=True)

    prompt: str
    sha256: str
    without: str | None = None


class Comparison(BaseModel):
    """The parts of a report that a promotion needs: `b` is judged against `a`."""

    model_config = ConfigDict(frozen=True)

    a: Side
    b: Side
    suite: str
    verdict: str


def passed(path: Path, current: Prompt, promoted: Prompt) -> str:
    """Return the reason for which a comparison allows a promotion, as text for a changelog.

    Args:
        path: of the report.
        current: must be its `a`.
        promoted: must be its `b`.

    Raises:
        InputError: it is no such report, is about other texts, or did not pass; the text says all.
    """
    report = _read_comparison(path)
    sides = (("a", report.a, current, "current"), ("b", report.b, promoted, "promoted"))
    wrong: list[str] = []
    for name, side, prompt, role in sides:
        if side.without:
            wrong.append(f"its {name} was tried without {side.without}")
        if not _is_named(side, prompt):
            wrong.append(f"its {name} is {side.prompt}, not {prompt.name}, the {role} version")
        elif side.sha256 != prompt.sha256:
            reported, current_sha = side.sha256[:12], prompt.sha256[:12]
            wrong.append(
                f"its {name} is another text of {prompt.name} ({reported}, not {current_sha})"
            )
    if report.verdict != "pass":
        wrong.append(f"its verdict is {report.verdict!r}, not 'pass'")
    if wrong:
        raise InputError(
            f"{path} does not allow it: {'; '.join(wrong)}. Compare {current.name} with "
            f"{promoted.name}, or promote with --force --why."
        )
    return f"passed on {report.suite} against {current.name}"


def verdict_of(path: Path, draft: Prompt) -> tuple[str, str]:
    """Return the verdict of a comparison on a draft that is to be released, alone and in words.

    Raises:
        InputError: it is no such report, or its `b` is another prompt or another text.
    """
    report = _read_comparison(path)
    if (report.b.prompt, report.b.sha256) != (draft.name, draft.sha256):
        raise InputError(
            f"{path} judges {report.b.prompt} ({report.b.sha256[:12]}), not {draft.name} "
            f"({draft.sha256[:12]}); compare that."
        )
    return report.verdict, f"{report.verdict} on {report.suite} against {report.a.prompt}"


def _is_named(side: Side, prompt: Prompt) -> bool:
    """Return whether a side is that prompt by name, or the draft that it was released from."""
    drafted = side.prompt.startswith(f"{prompt.id}@draft-") and side.sha256 == prompt.sha256
    return drafted or side.prompt == prompt.name


def _read_comparison(path: Path) -> Comparison:
    try:
        return Comparison.model_validate(parse_json(read_text(path), path))
    except ValidationError as error:
        what = f"{path} is no report of `formup eval compare`"
        raise InputError(f"{what}: {violations(error)}") from None
    except (ValueError, RecursionError):
        raise InputError(f"{path} is not JSON; give a report of `formup eval compare`.") from None
