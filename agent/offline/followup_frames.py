"""Which frame of followups.yaml takes all phrases of a clause, and what each is there for."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from .followup_words import Chunk, rules


class Slots(dict[str, list[Any]]):
    """What fills each kind of phrase, in order, and which kinds were looked at."""

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
        """What fills a kind."""
        self.used.add(name)
        return super().get(name, default)

    def has(self, *names: str) -> bool:
        """Whether a phrase of one of these kinds is there."""
        return len([name for name in names if name in self]) > 0  # looks at all of them

    @property
    def unused(self) -> set[str]:
        """Kinds of phrases that nothing has looked at, and that say something."""
        return {name for name in self if name not in self.used and name not in rules()["void"]}


@dataclass(frozen=True)
class Frame:
    """A way to say something: the kinds of phrases it needs and may have; `*` in `many`.

    Attributes:
        name: what it comes to.
        asks: whether only a question says it.
        needs: for each phrase that there must be its kinds.
        may: kinds of further phrases.
        many: kinds that may stand several times.
    """

    name: str
    asks: bool
    needs: tuple[tuple[str, ...], ...]
    may: tuple[str, ...]
    many: frozenset[str]

    def slots(self, chunks: Sequence[Chunk]) -> Slots | None:
        """What fills each kind, in order; None where a phrase is left over or missing."""
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
        """Every way to fill the needs."""
        if need == len(self.needs):
            yield taken
            return
        for kind in self.needs[need]:
            for k, chunk in enumerate(chunks):
                if kind in chunk.kinds and k not in taken:
                    yield from self._taken(chunks, need + 1, {**taken, k: kind})

    def _allowed(self, chunk: Chunk, kinds: dict[int, str], k: int) -> bool:
        """Whether a phrase beside the needed ones may stand there; notes as what."""
        used = set(kinds.values())
        for kind in (*self.may, *self.many):
            if kind in chunk.kinds and (kind in self.many or kind not in used):
                kinds[k] = kind
                return True
        return any(kind in chunk.kinds for kind in common())


@cache
def common() -> tuple[str, ...]:
    """Kinds of phrases that any frame takes: they say nothing more of it."""
    return tuple(rules()["common"])


@cache
def frames() -> tuple[Frame, ...]:
    """The frames, in the order in which they are tried."""
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
