"""`--contract FILE`: a contract as JSON, and the things in the picture that it names."""

import json
import re
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError

from ..agent.offline.stated import StatedContract
from ..tools.context import Settings
from ..tools.errors import InputError, ToolError
from ..tools.formation.contract import Contract
from ..tools.formation.units import contract_in_pixels
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.store import read_text
from ..tools.tool import violations

WRITTEN = ("text", "reading")
"""Fields in which c3 is no candidate."""


def decided(
    path: Path | None,
    pointed: tuple[TargetPrompt, ...],
    settings: Settings,
    *,
    model: str,
    planner: str | None,
) -> tuple[str | StatedContract, tuple[TargetPrompt, ...]]:
    """Who decides, and about what: the contract of a file if there is one, else the model.

    A candidate that the contract names by its id, such as c3, becomes the next of t1, t2, ...

    Args:
        path: of the file.
        pointed: what the person pointed at.
        settings: what the person fixed; it must not contradict the contract.
        model, planner: as named at the command line.

    Raises:
        InputError: the file cannot be read or used, or names what nothing points at.
    """
    if path is None:
        return model, pointed
    if model != "offline" or planner is not None:
        raise InputError("--contract leaves nothing to decide; leave out --model and --planner.")
    contract, things = _read(path, pointed)
    try:
        contract_in_pixels(contract, settings.metres_per_pixel)
    except ToolError:
        raise InputError(
            f'The lengths of --contract {path} cannot be used; say "unit": "px" in it, or "m" for '
            "a picture with --metres-per-pixel."
        ) from None
    fixed = (settings.clearance, settings.robot_radius) != (None, None)
    if fixed or settings.robots not in (None, contract.robots):
        raise InputError(
            f"-n, --clearance and --robot-radius cannot change --contract {path}, which is for "
            f"{contract.robots} robots; leave them out, or write them there."
        )
    return StatedContract(contract), things


def _read(
    path: Path, pointed: tuple[TargetPrompt, ...]
) -> tuple[Contract, tuple[TargetPrompt, ...]]:
    """The contract of a file, and the things that are pointed at or named in it."""
    try:
        data: Any = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"--contract {path} is not JSON: {error}.") from None
    names = {p.candidate: p.id for p in pointed if p.candidate is not None}
    data = _named(data, names, len(pointed))
    found = [TargetPrompt(id=n, candidate=c) for c, n in names.items()]
    things = (*pointed, *(p for p in found if p not in pointed))
    try:
        contract = Contract.model_validate(data)
    except ValidationError as error:
        raise InputError(
            f"--contract {path} is no contract: {violations(error)} "
            "formup tools schema contract prints what it may hold."
        ) from None
    missing = [n for n in contract.target_ids if n not in {p.id for p in things}]
    if missing:
        raise InputError(
            f"--contract {path} names {missing[0]!r}, which nothing points at; point at it with "
            "--point, --box, --outline or --target, or name a thing in the picture such as c3."
        )
    return contract, things


def _named(node: Any, names: dict[str, str], given: int) -> Any:
    """The JSON with candidates' ids replaced by those of things, which are added to `names`."""
    if isinstance(node, list):
        return [_named(item, names, given) for item in cast("list[Any]", node)]
    if isinstance(node, dict):
        fields = cast("dict[str, Any]", node)
        return {k: v if k in WRITTEN else _named(v, names, given) for k, v in fields.items()}
    if isinstance(node, str) and re.fullmatch("c[1-9][0-9]{0,3}", node):
        used = {f"t{i}" for i in range(1, given + 1)} | set(names.values())
        return names.setdefault(node, f"t{len(used) + 1}")
    return node
