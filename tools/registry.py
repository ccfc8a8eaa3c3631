"""Things found by name: those built in, and those that installed packages add by entry points.

A package adds one by an entry point of the group, such as `formup.fleets`; what is built in is
listed in the same form and loaded in the same way.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar, cast

from .errors import InputError

T = TypeVar("T")


@dataclass(frozen=True)
class Registry(Generic[T]):
    """Objects of one kind by name.

    Attributes:
        noun: what they are, for messages, such as `fleet`.
        group: group of the entry points that add more, such as `formup.fleets`.
        builtin: `module:attribute` of those that formup brings, by name.
    """

    noun: str
    group: str
    builtin: Mapping[str, str]

    def names(self) -> tuple[str, ...]:
        """Return all names: those built in first, then those of other packages, sorted."""
        others = entry_points(group=self.group).names - set(self.builtin)
        return (*self.builtin, *sorted(others))

    def load(self, name: str) -> T:
        """Return the object of a name.

        Raises:
            InputError: there is none, or its package cannot be imported.
        """
        value = self.builtin.get(name)
        found = () if value else entry_points(group=self.group, name=name)
        entry = EntryPoint(name, value, self.group) if value else next(iter(found), None)
        if entry is None:
            known = ", ".join(self.names())
            raise InputError(f"Unknown {self.noun} {name!r}. There are: {known}.")
        try:
            return cast("T", entry.load())
        except (ImportError, AttributeError) as error:
            raise InputError(
                f"The {self.noun} {name!r} ({entry.value}) cannot be imported: {error}."
            ) from None


def built(registry: Registry[Callable[..., T]], full_name: str) -> T:
    """Return the object that a registered class makes.

    Args:
        full_name: NAME, or NAME:CHECKPOINT for what is made from a checkpoint.

    Raises:
        InputError: there is none of that name, or it takes no checkpoint or not this one.
    """
    name, colon, checkpoint = full_name.partition(":")
    made = registry.load(name)
    if not colon:
        return made()
    if not inspect.signature(made).parameters:
        raise InputError(f"The {registry.noun} {name!r} takes no checkpoint; got {checkpoint!r}.")
    return made(checkpoint)
