"""`--contract FILE`: a contract as JSON, and the things in the picture that it names."""

import re
from pathlib import Path

from pydantic import ValidationError

from ..agent.offline.stated import StatedContract
from ..agent.session import SayOptions
from ..tools.context import Settings
from ..tools.errors import InputError, ToolError
from ..tools.formation.contract import Contract
from ..tools.formation.units import contract_in_pixels
from ..tools.perception.image import Picture
from ..tools.perception.target_prompt import TargetPrompt
from ..tools.store import read_text
from ..tools.tool import violations
from .arguments import Things

Who = tuple[str | StatedContract, str | None]
"""The model that decides, or the contract in its place, and its planner."""
CANDIDATE = re.compile(r'(?<!"text":)(?<!"text": )"(c[1-9][0-9]{0,3})"')


def resolve_decider(
    path: Path | None,
    pointed: Things,
    kept: Things,
    settings: Settings,
    *,
    model: str,
    planner: str | None,
    picture: Picture,
) -> tuple[Who, SayOptions]:
    """Return who decides, and about what: a file's contract if one is given, else the model.

    Args:
        kept: what no robot may enter; a contract may name it as k1, k2, ...
        picture: its file may state its scale.

    Raises:
        InputError: the file cannot be read, contradicts the other options, or names a thing that
            nothing points at.
    """
    if path is None:
        return (model, planner), SayOptions(pointed=pointed, keep_out=kept, settings=settings)
    if model != "offline" or planner is not None:
        raise InputError(
            "--contract leaves a model nothing to decide; leave out --model and --planner."
        )
    contract, things = _read(path, pointed)
    known = {p.id for p in things} | {f"k{i}" for i in range(1, len(kept) + 1)}
    missing = [n for n in contract.target_ids if n not in known]
    if missing:
        raise InputError(
            f"--contract {path} names {missing[0]!r}, which nothing points at; point at it with "
            "--point, --box, --outline, --target or --mask, or name a thing in the picture such as "
            "c3."
        )
    try:
        contract_in_pixels(contract, settings.metres_per_pixel or picture.metres_per_pixel)
    except ToolError:
        raise InputError(
            f'The lengths of --contract {path} cannot be used; set "unit": "px" in it, or "m" and '
            "give --metres-per-pixel."
        ) from None
    fixed = (settings.clearance, settings.robot_radius) != (None, None)
    if fixed or settings.robots not in (None, contract.robots):
        raise InputError(
            f"-n, --clearance and --robot-radius cannot change --contract {path}, which is for "
            f"{contract.robots} robots; leave them out, or change the file."
        )
    given = SayOptions(pointed=things, keep_out=kept, settings=settings)
    return (StatedContract(contract), None), given


def _read(path: Path, pointed: Things) -> tuple[Contract, Things]:
    """Read a contract and the things it is about; new candidates in it continue t1, t2, ..."""
    text = read_text(path)
    ids = {p.candidate: p.id for p in pointed if p.candidate is not None}
    named = [c for c in dict.fromkeys(CANDIDATE.findall(text)) if c not in ids]
    found = [TargetPrompt(id=f"t{len(pointed) + i}", candidate=c) for i, c in enumerate(named, 1)]
    ids |= {p.candidate: p.id for p in found}
    try:
        contract = Contract.model_validate_json(CANDIDATE.sub(lambda m: f'"{ids[m[1]]}"', text))
    except ValidationError as error:
        raise InputError(
            f"--contract {path} is not a valid contract: {violations(error)} "
            "formup tools schema contract prints the schema."
        ) from None
    return contract, (*pointed, *found)
