"""The frames of followups.yaml: which takes all phrases of a clause, and as what."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from .followup_chunks import Chunk
from .followup_words import rules


class Slots(dict[str, list[Any]]):
    """The values of each kind of phrase, in order; remembers which kinds were looked at."""

    def __init__(self, *given: Any, **more: Any) -> None:
        super().__init__(*given, **more)
        self.used: set[str] = set()

    def __getitem__(self, name: str) -> list[Any]:
        self.used.add(name)
        return super().__getitem__(name)

    def __contains__(self, name: object) -> bool:
        self.used.add(str(name))
        return super().__contains__(name)

    def get(self, name: str, default: Any = None) -> Any:
        """Return the values of a kind, and mark it as used."""
        self.used.add(name)
        return super().get(name, default)

    def has(self, *names: str) -> bool:
        """Return whether there is a phrase of any of these kinds, and mark all of them as used."""
        return len([name for name in names if name in self]) > 0  # looks at all of them

    @property
    def unused(self) -> set[str]:
        """Kinds of phrases that say something and that nothing has looked at."""
        return {name for name in self if name not in self.used and name not in rules()["void"]}


@dataclass(frozen=True)
class Frame:
    """A way to say something: the kinds of phrases it needs and may have.

    Attributes:
        name: of the function that returns its effects, or of what it asks or talks about.
        asks: whether only a question says it.
        needs: for each required phrase, the kinds that it may have.
        may: kinds of optional phrases.
        many: kinds that may occur several times, marked `*` in followups.yaml.
    """

    name: str
    asks: bool
    needs: tuple[tuple[str, ...], ...]
    may: tuple[str, ...]
    many: frozenset[str]

    def slots(self, chunks: Sequence[Chunk]) -> Slots | None:
        """Return the values of each kind, in order; None where a phrase is left over or missing."""
        for taken in self._taken(chunks, 0, {}):
            rest = [k for k in range(len(chunks)) if k not in taken]
            slots = Slots()
            kinds = dict(taken)
            if all(self._allowed(chunks[k], kinds, k) for k in rest):
                for k in sorted(kinds):
                    slots.setdefault(kinds[k], []).append(chunks[k].kinds[kinds[k]])
                slots.used.update(taken.values())
                return slots
        return None

    def _taken(
        self, chunks: Sequence[Chunk], need: int, taken: dict[int, str]
    ) -> Iterator[dict[int, str]]:
        """Yield every way to fill the needs, as phrase indices and kinds."""
        if need == len(self.needs):
            yield taken
            return
        for kind in self.needs[need]:
            for k, chunk in enumerate(chunks):
                if kind in chunk.kinds and k not in taken:
                    yield from self._taken(chunks, need + 1, {**taken, k: kind})

    def _allowed(self, chunk: Chunk, kinds: dict[int, str], k: int) -> bool:
        """Return whether a phrase beside the needed ones is allowed, and record its kind."""
        used = set(kinds.values())
        for kind in (*self.may, *self.many):
            if kind in chunk.kinds and (kind in self.many or kind not in used):
                kinds[k] = kind
                return True
        return "face" not in chunk.kinds and any(kind in chunk.kinds for kind in common())


@cache
def common() -> tuple[str, ...]:
    """Return the kinds of phrases that any frame takes, as they add nothing."""
    return tuple(rules()["common"])


@cache
def frames() -> tuple[Frame, ...]:
    """Return the frames in the order in which they are tried."""
    return tuple(map(_frame, rules()["frames"]))


def _frame(line: str) -> Frame:
    name, _, rest = line.partition(":")
    needs, _, may = rest.partition("/")
    words = [*needs.replace("|", " ").split(), *may.split()]
    return Frame(
        name.lstrip("?").strip(),
        name.startswith("?"),
        tuple(tuple(n.rstrip("*") for n in need.split("|")) for need in needs.split()),
        tuple(w.rstrip("*") for w in may.split()),
        frozenset(w.rstrip("*") for w in words if w.endswith("*")),
    )
