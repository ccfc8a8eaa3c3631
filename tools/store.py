"""Writes a world to a file and reads it: the state file of single tool calls, and plan.json.

Pictures are not in the file but named, with their hash; one that has changed is refused.
"""

import hashlib
import json
import secrets
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from io import StringIO
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError
from pydantic_core import to_json

from .errors import ImageError, InputError, StorageError
from .formation.value import Value
from .perception.image import Picture, load_picture
from .tool import violations
from .world import World, to_json_values

FORMAT = "formup/2"
MAX_BYTES = 64 << 20


class StoredWorld(Value):
    """A world as a file holds it.

    Attributes:
        digest: hash of the content, which shows alterations.
        plan_id: the plan that a plan.json is for.
        instruction: the instruction that the plan is for.
        picture: where the picture lay; it is first looked for beside the file, in `pictures`.
    """

    format: str = FORMAT
    digest: str = ""
    plan_id: str | None = None
    instruction: str | None = None
    picture: str | None = None
    world: World

    def to_bytes(self) -> bytes:
        """Return the file's content."""
        content = to_json_values(self)
        content["format"] = self.format
        content["digest"] = _digest(content)
        return json.dumps(content, indent=1, ensure_ascii=False).encode()


def plan_file(world: World, plan_id: str, instruction: str, picture: Picture) -> bytes:
    """Return a plan.json: one plan with all it depends on, to be approved and deployed as it is."""
    one = world.having(
        plans={plan_id: world.plans[plan_id]},
        current=plan_id,
        samples={},
        shown=(),
        doubted=None,
        arrivals={n: a for n, a in world.arrivals.items() if n == plan_id},
    )
    lay = picture.path and str(picture.path)
    stored = StoredWorld(plan_id=plan_id, instruction=instruction, picture=lay, world=one)
    return stored.to_bytes()


def read_world(path: Path) -> StoredWorld:
    """Read a state file or a plan.json.

    Raises:
        InputError: the file is missing, no JSON, of another format, damaged or altered.
    """
    try:
        data = parse_json(read_text(path), path)
    except (ValueError, RecursionError):
        raise StorageError(f"{path} is not JSON; a file written by formup is needed.") from None
    if not isinstance(data, dict) or cast(Any, data).get("format") != FORMAT:
        raise StorageError(f"{path} is no formup file of format {FORMAT!r}.")
    content = cast(dict[str, Any], data)
    try:
        stored = StoredWorld.model_validate(content)
        digest = _digest(content)
    except ValidationError as error:
        raise StorageError(f"{path} is damaged: {violations(error)}") from None
    except InputError as error:  # such as a scale that no picture has
        raise StorageError(f"{path} is damaged: {error}") from None
    except ValueError:
        raise StorageError(f"{path} is damaged: it holds text that is not Unicode.") from None
    world = stored.world
    altered = [name for name, node in world.plans.items() if node.plan.id != name]
    ids = [target.id for target in world.targets]
    if stored.digest != digest or altered or len(set(ids)) < len(ids):
        raise StorageError(
            f"{path} was altered after formup wrote it, so its plans are not certified; "
            "make the plan again."
        )
    return stored


def picture_of(stored: StoredWorld, path: Path, given: Picture | None = None) -> Picture:
    """Return the picture that a stored world is about.

    Args:
        path: of the file it was read from.
        given: the picture a person names; None to look beside the file and where it lay.

    Raises:
        ImageError: there is none, or it cannot be loaded.
        InputError: it has changed since.
    """
    wanted = stored.world.picture.sha256
    if given is None:
        beside = next(path.parent.glob(f"pictures/{wanted[:16]}.*"), None)
        lay = Path(stored.picture) if stored.picture is not None else None
        if beside is None and (lay is None or not lay.is_file()):
            where = f": it is no longer at {lay}" if lay else ""
            raise ImageError(
                f"The picture of {path} is not beside it{where}; give it as the image."
            )
        given = load_picture(beside or cast(Path, lay))
    if given.sha256 != wanted:
        raise InputError(
            f"{given.path or given.name} is not the picture this was made for, or it has changed "
            "since, which voids its targets and plans; run again on the new picture."
        )
    return given


def _digest(content: dict[str, Any]) -> str:
    """Return the SHA-256 of a file's content as it is written, without the digest in it."""
    return hashlib.sha256(to_json(content | {"digest": ""})).hexdigest()


def parse_json(text: str, source: object) -> Any:
    """Return the value of a JSON text, refusing what readers may take differently.

    Args:
        source: what an error names: a file, or an option.

    Raises:
        InputError: an object has the same name twice.
        ValueError, RecursionError: the text is no JSON.
    """

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"{source} has {twice!r} twice in one object; keep one of them.")
        return found

    return json.loads(text, object_pairs_hook=once)


def read_text(path: Path) -> str:
    """Return the text of a file a person named, without a byte order mark.

    Raises:
        StorageError: the file is missing, no regular file, too large, not readable, or neither
            UTF-8 nor UTF-16 with its byte order mark.
    """
    data = read_bytes(path)
    wide = data[:2] in (BOM_UTF16_LE, BOM_UTF16_BE)  # Excel and PowerShell write UTF-16 like this
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeError:
        raise StorageError(f"{path} is not JSON or text in UTF-8.") from None
    return StringIO(text, newline=None).read()


def read_bytes(path: Path) -> bytes:
    """Return the content of a file a person named.

    Raises:
        StorageError: the file is missing, no regular file, too large or not readable.
    """
    try:
        if path.exists() and not path.is_file():
            raise StorageError(f"{path} is no file that can be read.")
        if path.stat().st_size > MAX_BYTES:
            raise StorageError(f"{path} has more than {MAX_BYTES >> 20} MiB.")
        return path.read_bytes()
    except OSError as error:
        raise StorageError(f"{path}: {error.strerror or error}.") from None


def write_whole(path: Path, data: bytes) -> None:
    """Write a file as a whole or not at all, readable by whomever the person's umask allows.

    What is no file, such as /dev/stdout, is written to and stays what it is; a link is followed.

    Raises:
        StorageError: it cannot be written there.
    """
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            path.write_bytes(data)
            return
        path = path.resolve() if path.is_symlink() else path
        part = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
        try:
            with part.open("xb") as file:
                file.write(data)
            part.replace(path)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise StorageError(f"{path} cannot be written: {error.strerror or error}.") from None
