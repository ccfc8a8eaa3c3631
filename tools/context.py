"""The context that one tool call works with: the world, the person's settings, and services.

Services hold what is not state: pixels, the networks and rules that find and measure things, the
fleet, and caches by content hash. Whatever a tool finds out or decides goes into the next world.
"""

import hashlib
from collections.abc import Awaitable, Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

from .errors import InputError, StorageError, ToolError
from .fleet.described import fleet_named, stated_radius
from .fleet.follow import Rigid
from .fleet.protocol import Fleet, Pose
from .formation.plan import Plan
from .formation.units import check_scale
from .formation.value import Value
from .geometry.outline import FloatArray
from .perception.detection import Finder
from .perception.detectors.protocol import Detector
from .perception.detectors.registry import detector_named
from .perception.detectors.vlm import VlmDetector
from .perception.image import Picture
from .perception.named import with_named
from .perception.referring.attributes import Candidate
from .perception.segmenters.registry import segmenter_named
from .perception.target_prompt import Point
from .world import Step, World

MOST_FOUND = 64
"""Most pictures whose candidates are remembered."""
_FOUND: dict[tuple[str, ...], tuple[Candidate, ...]] = {}
BESIDE = "standout+"
"""Prefix to the name of a detector that knows words: what stands out is found as well."""
Descriptor = Literal["edges", "edges+vertices", "matrix"]
SAME_PLACE = 1.0
"""How far the box of a candidate may be from where it was shown, px."""


class Settings(Value):
    """What the person fixed; code holds the model to it.

    Attributes:
        robots: how many, or None where the person left it open.
        robot_radius: px, 0 is a point; None leaves it to the contract.
        clearance: exact distance wanted from the target, px, or None for the default.
        detector: name of the detector, with its checkpoint after a colon, with BESIDE before it.
        segmenter: name of the segmenter, likewise with a checkpoint.
        threshold: t, the least confidence a mask is used at; None for the segmenter's own.
        descriptor: how describe_shape puts shapes into text.
        fleet: name of the fleet.
        starts: starting positions (x, y) of simulated robots, px, or None to spread them.
        seed: of everything random in the simulator.
        may_deploy: whether robots may be moved at all.
        approved: id of the one plan that a person has approved.
        numbered: whether what stands out is numbered in the picture a model gets.
        metres_per_pixel: of a picture taken straight from above; None where it is not known.
    """

    robots: int | None = None
    robot_radius: float | None = None
    clearance: float | None = None
    detector: str = "standout"
    segmenter: str = "grabcut"
    threshold: float | None = None
    descriptor: Descriptor = "edges"
    fleet: str = "simulated"
    starts: tuple[Point, ...] | None = None
    seed: int = 0
    may_deploy: bool = True
    approved: str | None = None
    numbered: bool = False
    metres_per_pixel: float | None = None


def check_settings(settings: Settings) -> None:
    """Refuse unknown names, and settings that do not go together.

    Raises:
        InputError: the settings have such a name, or do not go together.
    """
    segmenter = segmenter_named(settings.segmenter)
    detector = detector_named(settings.detector.removeprefix(BESIDE))
    if isinstance(detector, Finder) and "box" not in segmenter.takes:
        raise InputError(
            f"The detector {detector.name!r} gives boxes, which the segmenter "
            f"{segmenter.name!r} does not take; choose another of the two."
        )
    if settings.detector.startswith(BESIDE) and not isinstance(detector, Finder):
        raise InputError(f"{BESIDE} goes with a detector that knows words; got {detector.name!r}.")
    fleet_named(settings.fleet)


class Artefacts(Protocol):
    """Files by the hash of their content: pictures, and the tracks of robots on their way."""

    def put(self, data: bytes) -> str:
        """Store a file and return the SHA-256 of its content, hex.

        Raises:
            StorageError: it cannot be written.
        """
        ...

    def get(self, sha256: str) -> bytes:
        """Return a file's content.

        Raises:
            StorageError: the file is missing, or not what it was.
        """
        ...


class MemoryArtefacts:
    """Files in memory, which are gone when the program ends."""

    def __init__(self) -> None:
        self._files: dict[str, bytes] = {}

    def put(self, data: bytes) -> str:
        """See `Artefacts.put`."""
        sha256 = hashlib.sha256(data).hexdigest()
        self._files[sha256] = data
        return sha256

    def get(self, sha256: str) -> bytes:
        """See `Artefacts.get`."""
        if sha256 not in self._files:
            raise StorageError(f"There is no file {sha256[:16]} in memory.")
        return self._files[sha256]


USUAL = Settings()


async def _unshared(name: str, opened: Callable[[], Fleet]) -> Fleet:
    """Open a fleet that no other process uses."""
    return opened()


def _ignore(*what: object) -> None:
    """Ignore what a tool observes."""


Watch = Callable[[tuple[Pose, ...]], None]


class Shown(Protocol):
    """Shows the poses of driving robots and, if they follow a thing, how it has moved."""

    def __call__(self, poses: tuple[Pose, ...], moved: Rigid | None = None, /) -> None:
        """Show them."""
        ...


View = Callable[["Context", Plan, Fleet], AbstractContextManager[Shown]]


def unseen(context: "Context", plan: Plan, fleet: Fleet) -> AbstractContextManager[Shown]:
    """Show the robots to nobody."""
    return nullcontext(_ignore)


async def _unrecorded(plan_id: str) -> None:
    """Do not record that robots move."""


@dataclass
class Services:
    """What tools use beside the world; nothing in here decides what happens.

    Attributes:
        pictures: those of the conversation, by their hash.
        fleets: the robots in use, by the name of their fleet.
        artefacts: files that events and the world name by their hash.
        found: what detectors found in pictures, by detector, picture, segmenter and phrases; shared
            by all services that are not given their own.
        ways: how robots were planned to get to plans, (k, 2) px by robot, by the plan's id.
        asked: the same where a model was asked; not shared with other conversations.
        stopped: names of fleets that were stopped when they were closed.
        claim: called with a fleet's name and what opens it; returns the fleet to use, or raises if
            it belongs to another process.
        watch: called with the poses of driving robots, to show them.
        view: called with the context, a plan and the fleet that drives to it; what it yields is
            called with the poses too for as long as the drive lasts.
    """

    pictures: dict[str, Picture] = field(default_factory=dict[str, Picture])
    fleets: dict[str, Fleet] = field(default_factory=dict[str, Fleet])
    artefacts: Artefacts = field(default_factory=MemoryArtefacts)
    found: dict[tuple[str, ...], tuple[Candidate, ...]] = field(default_factory=lambda: _FOUND)
    asked: dict[tuple[str, ...], tuple[Candidate, ...]] = field(
        default_factory=dict[tuple[str, ...], tuple[Candidate, ...]]
    )
    ways: dict[str, dict[str, FloatArray]] = field(default_factory=dict[str, dict[str, FloatArray]])
    stopped: set[str] = field(default_factory=set[str])
    claim: Callable[[str, Callable[[], Fleet]], Awaitable[Fleet]] = _unshared
    watch: Watch = _ignore
    view: View = unseen

    @property
    def is_stopped(self) -> bool:
        """Whether a stop is in force."""
        return bool(self.stopped) or any(fleet.stopped for fleet in self.fleets.values())

    async def close_fleets(self) -> None:
        """Close all fleets; a stop stays in force when they are opened again."""
        for name, fleet in self.fleets.items():
            if fleet.stopped:
                self.stopped.add(name)
            await fleet.close()
        self.fleets.clear()

    @classmethod
    def of(cls, picture: Picture) -> "Services":
        """Return services for a conversation about one picture."""
        return cls({picture.sha256: picture})


@dataclass(frozen=True)
class Context:
    """What a tool call works with.

    Attributes:
        words: what the person said last, which the contract is checked against.
        doubted: doubts that the model was told of in this turn, which its `reading` may answer.
        proposed: id of the plan that an earlier call of the same reply made.
        agreed: whether a person has said yes to this very call.
        asks: detector that asks the model that decides where things are; None outside its turns.
        steps: the step that undo ends at, then one for each turn that changed the plan.
        observed: puts a world in place at once, because what it says was observed and holds even
            if the call fails or is cut off: measured things, poses of robots.
        moving: awaited with a plan's id before the first motion; raising prevents it.
    """

    world: World
    services: Services
    settings: Settings = USUAL
    words: str = ""
    doubted: frozenset[str] = frozenset()
    proposed: str | None = None
    agreed: bool = False
    asks: VlmDetector | None = None
    steps: tuple[Step, ...] = ()
    observed: Callable[[World], None] = _ignore
    moving: Callable[[str], Awaitable[None]] = _unrecorded

    @classmethod
    def of(
        cls,
        picture: Picture,
        settings: Settings | None = None,
        world: World | None = None,
        services: "Services | None" = None,
    ) -> "Context":
        """Return the context of a conversation about one picture.

        Raises:
            InputError: an unknown segmenter, detector or fleet, or an impossible scale.
        """
        services = services or Services()
        services.pictures[picture.sha256] = picture
        made = cls(world or World.of(picture), services, settings or USUAL)
        return made.check()

    def check(self) -> "Context":
        """Check the person's settings and return the context with their scale in the world.

        Robots are as large as the fleet's file says, unless the person said otherwise.

        Raises:
            InputError: an unknown segmenter, detector or fleet, or an impossible scale.
        """
        check_settings(self.settings)
        sized = self
        if self.settings.robot_radius is None:
            stated = {"robot_radius": stated_radius(self.settings.fleet)}
            sized = replace(self, settings=self.settings.model_copy(update=stated))
        scale = self.settings.metres_per_pixel
        if scale is None or scale == self.world.metres_per_pixel:
            return sized
        check_scale(scale)
        return replace(sized, world=self.world.having(metres_per_pixel=scale))

    def at(self, world: World) -> "Context":
        """Return the same context with another world."""
        return replace(self, world=world)

    @property
    def picture(self) -> Picture:
        """The picture with its pixels."""
        return self.services.pictures[self.world.picture.sha256]

    @property
    def _detector(self) -> Detector:
        detector = detector_named(self.settings.detector.removeprefix(BESIDE))
        return self.asks if self.asks and detector.name == self.asks.name else detector

    @property
    def finder(self) -> Finder | None:
        """What finds things by a noun: the detector, else the segmenter; None where neither can."""
        known = (self._detector, segmenter_named(self.settings.segmenter))
        return next((one for one in known if isinstance(one, Finder)), None)

    def looking_for(self, nouns: Iterable[str]) -> "Context":
        """Return the same context with what nouns name among the candidates."""
        phrases = tuple(dict.fromkeys((*self.world.phrases, *map(noun_phrase, nouns))))
        return self.at(self.world.having(phrases=phrases))

    def candidates(self) -> tuple[Candidate, ...]:
        """Return the things found in the picture: what stands out, then what phrases name.

        The picture is searched once for each.
        """
        return self._candidates(self.world.phrases)

    def _candidates(self, phrases: tuple[str, ...]) -> tuple[Candidate, ...]:
        finder, settings = self.finder, self.settings
        if finder is None:
            phrases = ()
        names = (settings.segmenter, *phrases) if phrases else ()
        key = (settings.detector, self.world.picture.sha256, *names)
        asks = phrases and isinstance(finder, VlmDetector)
        kept = self.services.asked if asks else self.services.found
        if asks and key not in kept and self.asks is None:
            return self._candidates(phrases[:-1])
        if key not in kept:
            if finder is not None and phrases:
                before, masks = self._candidates(phrases[:-1]), segmenter_named(settings.segmenter)
                found = with_named(before, self.picture, phrases[-1], finder, masks)
            else:
                beside = settings.detector.startswith(BESIDE)
                detector = detector_named("standout") if beside else self._detector
                found = detector.detect(self.picture)
            for old in [*kept][: 1 - MOST_FOUND]:
                kept.pop(old, None)
            kept[key] = found
        return kept[key]

    def candidate(self, name: str) -> Candidate:
        """Return the candidate with an id; if one was shown as that, the one at the same place.

        Raises:
            ToolError: there is none; the text says which there are.
        """
        found = self.candidates()
        shown = next((s for s in self.world.shown if s.id == name), None)
        for candidate in found:
            if shown is None and candidate.id == name:
                return candidate
            if (
                shown is not None
                and _box_distance(candidate.outline.bounds, shown.box) <= SAME_PLACE
            ):
                return candidate
        known = f"c1 to c{len(found)}" if found else "none: nothing stands out in this picture"
        raise ToolError(f"There is no candidate {name!r}. Candidates: {known}.")


def noun_phrase(words: str) -> str:
    """Return words for a thing as detectors take them: lower case, no article, single spaces."""
    said = words.lower().split()
    return " ".join(said[1:] if said[:1] in (["a"], ["an"], ["the"]) else said)


def _box_distance(box: tuple[float, ...], other: tuple[float, ...]) -> float:
    """Return the largest distance between the same sides of two boxes, px."""
    return max(abs(a - b) for a, b in zip(box, other, strict=True))
