"""Writes to a log what has changed in a world since the event before, and reads it again.

However many changes are read, each item that is left of them is validated once.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, cast

from .formation.value import Value
from .world import KeepOut, Step, Target, World, to_json_values

KEYED = frozenset({"plans", "arrivals", "samples"})
BY_ID = KEYED | {"targets", "keep_out"}
"""Parts of the world whose items have ids."""


class TurnEnd(NamedTuple):
    """What undo restores of a turn's end, and how many steps were taken back then."""

    step: Step
    undone: int


def changes_since(world: World, before: World | None) -> dict[str, Any]:
    """Return what differs from an earlier world, as JSON that `with_changes` reads.

    Of the parts that go by id (targets, plans, ...) only new and changed items are written, with
    the order of all ids unless those items come last; other parts are written whole.
    """
    changed: dict[str, Any] = {}
    for name in World.model_fields:
        now, then = getattr(world, name), getattr(before, name, None)
        if now is then:
            continue
        if name in BY_ID:
            old, new = _by_id(then), _by_id(now)
            items = {key: item for key, item in new.items() if old.get(key) is not item}
            if items or list(old) != list(new):
                usual = [*(key for key in old if key not in items), *items] == list(new)
                order = {} if usual else {"ids": list(new)}
                changed[name] = order | {"items": to_json_values(items)}
        elif now != then:
            changed[name] = to_json_values(now)
    return changed


def with_changes(world: World, *changes: Mapping[str, Any]) -> World:
    """Return the world after changes that `changes_since` wrote, one after another.

    Raises:
        ValidationError, KeyError, TypeError, ValueError, AttributeError: it did not write them.
    """
    return after_turns(world, [changes])[0]


def after_turns(
    world: World, turns: Sequence[Sequence[Mapping[str, Any]]]
) -> tuple[World, tuple[TurnEnd, ...]]:
    """Return the world after the changes of several turns, and what undo restores of their ends.

    Raises:
        ValidationError, KeyError, TypeError, ValueError, AttributeError: see `with_changes`.
    """
    parts: dict[str, Any] = {}
    ends: list[dict[str, Any]] = []
    for changes in turns:
        for change in changes:
            _apply(change, parts, world)
        now = {n: parts.get(n, getattr(world, n)) for n in (*Step.model_fields, "undone")}
        ends.append({n: _by_id(part) if n in BY_ID else part for n, part in now.items()})
    lists = {n: tuple(parts[n].values()) for n in parts.keys() & BY_ID - KEYED}
    read = World.model_validate({"picture": world.picture, **parts, **lists})
    after = world.model_copy(update={name: getattr(read, name) for name in parts})
    items = _Items()
    return after, tuple(TurnEnd(items.step(end), end["undone"]) for end in ends)


def _apply(change: Mapping[str, Any], parts: dict[str, Any], world: World) -> None:
    """Apply a change to parts of a world that are not validated yet."""
    for name, value in change.items():
        if name not in BY_ID:
            parts[name] = value
            continue
        items = parts.setdefault(name, _by_id(getattr(world, name)))
        for key, item in value["items"].items():
            items.pop(key, None)
            items[key] = item
        if "ids" in value:
            parts[name] = {key: items[key] for key in value["ids"]}


class _Items:
    """Validated items by the JSON they were read from."""

    def __init__(self) -> None:
        self._read: dict[int, Value] = {}

    def step(self, end: Mapping[str, Any]) -> Step:
        targets, keep_out = self._all(Target, end["targets"]), self._all(KeepOut, end["keep_out"])
        parts = {"samples": end["samples"], "current": end["current"]}
        return Step.model_validate({"targets": targets, "keep_out": keep_out, **parts})

    def _all(self, kind: type[Value], part: Mapping[str, Any]) -> tuple[Value, ...]:
        for item in part.values():
            if id(item) not in self._read:
                self._read[id(item)] = kind.model_validate(item)
        return tuple(self._read[id(item)] for item in part.values())


def _by_id(part: Any) -> dict[str, Any]:
    if isinstance(part, dict):
        return dict(cast(dict[str, Any], part))
    return {item.id: item for item in cast(tuple[Any, ...], part or ())}
