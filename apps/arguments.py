"""Parsing of command-line words; each error is one sentence: the value and what is allowed."""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError

from ..agent.limits import Limits
from ..agent.policy import Policy
from ..prompts.inputs import Input
from ..tools.context import Descriptor
from ..tools.errors import InputError
from ..tools.formation.contract import MAX_LENGTH, MAX_ROBOTS
from ..tools.formation.quantities import quantities_in
from ..tools.formation.units import COARSEST, FINEST
from ..tools.perception.image import Picture
from ..tools.perception.imports.masks import masks_in
from ..tools.perception.target_prompt import MAX_VERTICES, TargetPrompt
from ..tools.store import read_bytes, read_text
from ..tools.tool import violations

Things = tuple[TargetPrompt, ...]


def robots(text: str | None) -> int | None:
    """Parse a number of robots.

    Raises:
        InputError: the text is not a whole number from 1 to 10,000.
    """
    if text is None:
        return None
    return whole("--robots", text, least=1, most=MAX_ROBOTS)


def whole(name: str, text: str, *, least: int, most: int = 1_000_000) -> int:
    """Parse a whole number in a range, such as 12000 or 12,000.

    Raises:
        InputError: the text is not such a number.
    """
    plain = re.fullmatch(r"[0-9]{1,9}|[0-9]{1,3}(,[0-9]{3})+", text.strip())
    value = int(plain[0].replace(",", "")) if plain else least - 1
    if not least <= value <= most:
        raise InputError(
            f"{name} {text!r} cannot be used; give a whole number from {least} to {most:,}."
        )
    return value


def scale(text: str | None) -> float | None:
    """Parse a scale in metres per pixel.

    Raises:
        InputError: the text is not a number, or outside the range of plausible scales.
    """
    form = f"a number from {FINEST:f} to {COARSEST:g}, such as 0.05"
    return _number_where(lambda v: FINEST <= v <= COARSEST, "--metres-per-pixel", text, form)


def numbers(
    robots_text: str | None,
    scale_text: str | None,
    radius: str | None,
    clearance: str | None,
    threshold: str | None,
    seed: str,
    picture: Picture | None,
) -> dict[str, Any]:
    """Parse robots, scale, the robots' radius, clearance, threshold and seed, for `Settings`.

    Args:
        picture: its file may state its scale, which metric lengths use if none is given.

    Raises:
        InputError: one of them is not a number, or not in its range.
    """
    given = scale(scale_text)
    known = picture.metres_per_pixel if picture is not None and given is None else given
    return {
        "robots": robots(robots_text),
        "metres_per_pixel": given,
        "robot_radius": length("--robot-radius", radius, known),
        "clearance": length("--clearance", clearance, known),
        "threshold": share("--threshold", threshold),
        "seed": whole("--seed", seed, least=0),
    }


def length(name: str, text: str | None, metres_per_pixel: float | None) -> float | None:
    """Parse a length, in pixels or with a unit such as m, cm or mm; return pixels, 0 or more.

    Raises:
        InputError: the text is not a length, or is metric in a picture without a scale.
    """
    if text is None:
        return None
    value = _number(text)
    if value is None:
        value = _metric(name, text, metres_per_pixel)
    if value is None or not 0 <= value <= MAX_LENGTH:
        raise InputError(
            f"{name} {text!r} is not a length; give pixels from 0 to 100000, such as 12, or a "
            "metric length such as 1.5m or 40cm together with --metres-per-pixel."
        )
    return value


def _metric(name: str, text: str, metres_per_pixel: float | None) -> float | None:
    """Return in pixels a length given with its unit; None if the text is not one."""
    found = quantities_in(text.strip())
    if len(found) != 1 or found[0].wording != text.strip() or not found[0].is_length:
        return None
    if found[0].least < found[0].most:
        return None
    px = found[0].px(metres_per_pixel)
    if px is None:
        raise InputError(
            f"{name} {text!r} is metric, and the picture has no scale; give --metres-per-pixel "
            "too, or pixels."
        )
    return px[0]


def share(name: str, text: str | None) -> float | None:
    """Parse a number from 0 to 1.

    Raises:
        InputError: the text is not such a number.
    """
    return _number_where(lambda v: 0 <= v <= 1, name, text, "a number from 0 to 1")


def rates(name: str, texts: list[str] | None, models: Sequence[str]) -> dict[str, float]:
    """Parse texts MODEL=N; return each N, above 0, by model.

    Args:
        models: the models of this run.

    Raises:
        InputError: a text is not of that form, or names another model.
    """
    found: dict[str, float] = {}
    for text in texts or []:
        model, _, number = text.rpartition("=")
        value = _number(number)
        if model not in models or value is None or not value > 0:
            known = ", ".join(models) or "none"
            raise InputError(
                f"{name} {text!r} cannot be used; give MODEL=N, N above 0, such as "
                f"openai:NAME=60. Models of this run: {known}."
            )
        found[model] = value
    return found


def dollars(name: str, text: str | None) -> float | None:
    """Parse an amount of money in US dollars.

    Raises:
        InputError: the text is not a number above 0 and up to a million.
    """
    return _number_where(
        lambda v: 0 < v <= 1_000_000, name, text, "US dollars above 0, such as 2.50"
    )


def descriptor(text: str) -> Descriptor:
    """Parse the way in which shapes are described in text.

    Raises:
        InputError: the text is not one of the three.
    """
    for known in get_args(Descriptor):
        if text == known:
            return known
    raise InputError(f"Unknown descriptor {text!r}. There are: {', '.join(get_args(Descriptor))}.")


def pointed(
    points: list[str] | None,
    boxes: list[str] | None,
    outlines: list[str] | None,
    candidates: list[str] | None,
    option: str | None = None,
) -> tuple[TargetPrompt, ...]:
    """Parse what was pointed at, as t1, t2, ...: points, boxes, outlines, then candidates.

    Args:
        option: the one option that all of them were given with, for errors; None if each kind
            has its own.

    Raises:
        InputError: a part is not a number, there are too few or too many numbers, or a
            candidate's id is malformed.
    """
    found: list[dict[str, object]] = []
    for text in points or []:
        values = _numbers(text, option or "--point", "X,Y")
        if len(values) % 2:
            raise InputError(_wrong("--point", text, "X,Y, or X1,Y1,X2,Y2,... for one thing,"))
        found.append({"points": tuple(zip(values[::2], values[1::2], strict=True))})
    for text in boxes or []:
        values = _numbers(text, option or "--box", "X0,Y0,X1,Y1")
        if len(values) != 4:
            raise InputError(_wrong("--box", text, "X0,Y0,X1,Y1"))
        found.append({"box": tuple(values)})
    for text in outlines or []:
        values = _numbers(text, option or "--outline", "X1,Y1,X2,Y2,...")
        if len(values) % 2 or not 6 <= len(values) <= 2 * MAX_VERTICES:
            raise InputError(
                f"{option or '--outline'} {text!r} has {len(values)} numbers; give 3 to "
                f"{MAX_VERTICES} vertices as X1,Y1,X2,Y2,..."
            )
        found.append({"outline": tuple(zip(values[::2], values[1::2], strict=True))})
    for text in candidates or []:
        found.append({"candidate": _candidate(text, option or "--target")})
    try:
        return tuple(
            TargetPrompt.model_validate({"id": f"t{i}", **prompt})
            for i, prompt in enumerate(found, start=1)
        )
    except ValidationError as error:
        raise InputError(violations(error)) from None


def shown(
    ways: Sequence[list[str] | None], files: Sequence[Path] | None, picture: Picture | None
) -> list[Things]:
    """Return groups of things: one for each prompt of `pointed`, then one for each mask file.

    Args:
        ways: points, boxes, outlines and candidates.

    Raises:
        InputError: as `pointed`; or a file has no picture, cannot be read or does not fit it.
    """
    if files and picture is None:
        raise InputError("--mask needs the picture that it belongs to; give IMAGE or --camera too.")
    points, boxes, outlines, candidates = ways
    found: list[Things] = [(p,) for p in pointed(points, boxes, outlines, candidates)]
    for file in files or ():
        assert picture is not None
        masks = masks_in(read_bytes(file), file.name, picture.size, picture)
        found.append(tuple(TargetPrompt(label=m.label, mask=m.mask) for m in masks))
    return found


def numbered(groups: Iterable[Things]) -> Things:
    """Flatten groups of things and number them t1, t2, ..."""
    things = (thing for group in groups for thing in group)
    return tuple(t.model_copy(update={"id": f"t{i}"}) for i, t in enumerate(things, start=1))


def keep_out_things(texts: list[str] | None) -> tuple[TargetPrompt, ...]:
    """Parse what no robot may enter; the count of numbers tells point, box, outline, candidate.

    Raises:
        InputError: a text is none of these.
    """
    ways: tuple[list[str], ...] = ([], [], [], [])
    for text in texts or []:
        ways[{2: 0, 4: 1, 1: 3}.get(text.count(",") + 1, 2)].append(text)
    return pointed(*ways, option="--keep-out")


def limits(given: list[str] | None, before: Mapping[str, Any] | None = None) -> Limits:
    """Parse limits NAME=VALUE, which override those before.

    Raises:
        InputError: there is no such limit, or the value is not allowed for it.
    """
    names = [field.name for field in fields(Limits)]
    found: dict[str, Any] = dict(before or {})
    for text in given or []:
        name, _, written = text.partition("=")
        value = _number(written)
        whole = name in ("requests", "tool_calls", "tokens")
        lifted = written == "none"
        if name not in names or not (lifted or (value and (not whole or value == int(value)))):
            raise InputError(
                f"--limit {text!r} cannot be used; give NAME=NUMBER, or NAME=none for no limit, "
                f"with one of {', '.join(names)}."
            )
        found[name] = None if lifted or value is None else int(value) if whole else value
    return Limits(**found)


def policy(given: list[str] | None, before: Sequence[Sequence[str]] = ()) -> Policy:
    """Parse a policy from rules GLOB=DECISION, which come ahead of those before.

    Raises:
        InputError: a text is not such a rule.
    """
    for text in given or []:
        if not re.fullmatch("[^=]+=(allow|ask|refuse)", text):
            raise InputError(
                f"--policy {text!r} cannot be used; give GLOB=allow, GLOB=ask or GLOB=refuse, such "
                "as deploy=ask."
            )
    rules: list[Any] = [*(text.rpartition("=")[::2] for text in given or []), *before]
    return Policy(tuple((glob, decision) for glob, decision in rules))


def variables(given: list[str] | None, declared: Mapping[str, Input]) -> dict[str, object]:
    """Parse values NAME=VALUE for the inputs of a prompt, which itself checks them later.

    Raises:
        InputError: a text is not NAME=VALUE, or a name is given twice.
    """
    found: dict[str, object] = {}
    for text in given or []:
        name, equals, written = text.partition("=")
        if not equals or name in found:
            why = "is given twice" if equals else "has no ="
            raise InputError(f"--var {text!r} {why}; give NAME=VALUE, each name once.")
        found[name] = declared[name].read(written) if name in declared else written
    return found


def scores(path: Path | None) -> dict[str, dict[str, float]]:
    """Read scores by prompt and suite from a JSON file; return none if there is no file.

    Raises:
        InputError: the file cannot be read, or is not of that form.
    """
    if path is None:
        return {}
    try:
        return TypeAdapter(dict[str, dict[str, float]]).validate_json(read_text(path))
    except ValidationError as error:
        form = '{"ID@VERSION": {"SUITE": NUMBER}}'
        raise InputError(f"--baselines {path} must hold {form}: {violations(error)}") from None


def recording(path: Path | None) -> Path | None:
    """Check, ahead of the run, that a recording can be written to a path, and return the path.

    Raises:
        InputError: its folder does not exist, or the path is itself a folder.
    """
    if path is not None and (path.is_dir() or not path.parent.is_dir()):
        raise InputError(f"--record {path} cannot be written; name a file in an existing folder.")
    return path


def _candidate(text: str, option: str) -> str:
    known = re.fullmatch(r"[cC]?([1-9][0-9]{0,3})", text.strip(), re.ASCII)
    if known is None:
        raise InputError(
            f"{option} {text!r} cannot be read; give a candidate's id such as c3, or its number."
        )
    return f"c{known[1]}"


def _number_where(
    allowed: Callable[[float], bool], name: str, text: str | None, form: str
) -> float | None:
    """Parse a number and check that it is allowed; `form` tells the error what is."""
    value = None if text is None else _number(text)
    if text is not None and (value is None or not allowed(value)):
        raise InputError(f"{name} {text!r} cannot be used; give {form}.")
    return value


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _numbers(text: str, option: str, form: str) -> list[float]:
    values = [_number(part) for part in text.split(",")]
    known = [v for v in values if v is not None]
    if len(known) < len(values):
        raise InputError(_wrong(option, text, form))
    return known


def _wrong(option: str, text: str, form: str) -> str:
    return f"{option} {text!r} cannot be read; give {form} in pixels, separated by commas."
