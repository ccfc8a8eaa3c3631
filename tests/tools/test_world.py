"""The world changes by whole values, and what a log writes of that folds to the same world."""

import json
from collections.abc import Callable
from functools import reduce
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from formup.tools.context import Context, MemoryArtefacts, Settings
from formup.tools.errors import InputError, StorageError, ToolError
from formup.tools.fleet.arrival import Arrival
from formup.tools.fleet.protocol import Pose
from formup.tools.formation.contract import Contract, Group
from formup.tools.formation.plan import Plan, make_plan
from formup.tools.geometry.outline import Outline, make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt
from formup.tools.world import KeepOut, PlanNode, ShownCandidate, Target, World
from formup.tools.world_changes import changes_since, with_changes
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

PICTURE = picture_from_array(np.full((200, 300, 3), 90, np.uint8))
EMPTY = World.of(PICTURE)
BOTH = Contract(groups=(Group(relation="between", targets=("t1", "t2"), robots=2),))
Step = Callable[[World], World]

numbers = st.floats(0, 190, allow_subnormal=False)
points = st.tuples(numbers, numbers)
deviations = st.tuples(numbers, numbers, numbers)
names = st.text(max_size=8).filter(lambda text: "\ud800" not in text)


@st.composite
def outlines(draw: st.DrawFn) -> Outline:
    """A quadrilateral, sometimes with a hole."""
    x, y = draw(points)
    wide, high = draw(st.floats(12, 90)), draw(st.floats(12, 90))
    lean = draw(st.floats(-5, 5))
    ring = [(x + lean, y), (x + wide, y), (x + wide - lean, y + high), (x, y + high)]
    if not draw(st.booleans()):
        return make_outline(ring)
    u, v = x + wide / 2, y + high / 2
    hole = [(u - 3.1, v - 3), (u + 3, v - 3), (u + 3, v + 3.3)]
    return make_outline(ring, (hole,))


prompts = st.builds(
    TargetPrompt,
    id=st.sampled_from(["t1", "t2"]),
    outline=st.lists(points, min_size=3, max_size=5).map(tuple),
    negative=st.lists(points, max_size=2).map(tuple),
)
targets = st.builds(
    Target,
    id=st.sampled_from(["t1", "t2", "t3"]),
    label=names,
    box=st.tuples(numbers, numbers, numbers, numbers),
    confidence=st.floats(0, 1),
    outline=outlines(),
    prompt=st.sampled_from(["box", "outline"]),
    parts=st.dictionaries(st.sampled_from(["edges", "colour"]), st.floats(0, 1)),
    missed=st.lists(deviations, max_size=2).map(tuple),
    added=st.lists(deviations, max_size=2).map(tuple),
    source=st.none() | prompts,
)
poses = st.lists(
    st.builds(
        Pose,
        id=st.sampled_from(["1", "2", "r3", "r4", "5"]),
        x=numbers,
        y=numbers,
        heading=st.none() | numbers,
        seen=numbers,
    ),
    max_size=5,
    unique_by=lambda pose: pose.id,
).map(tuple)


def plan_of(world: World, places: list[tuple[float, float]], *, robots: bool) -> Plan:
    contract = Contract(groups=(Group(relation="shape", robots=len(places)),))
    plan = make_plan(contract, world.site(contract), world.version_of(contract), places)
    ids = [str(i) for i in range(1, len(places) + 1)]
    return plan.for_robots(ids[::-1], [*ids, "idle"]) if robots else plan


def arrival_of(plan: Plan, off: float) -> Arrival:
    positions = plan.formation.positions
    return Arrival(
        arrived=off < 100,
        ended="arrived" if off < 100 else "short",
        robots=plan.formation.robot_of_place,
        observed=positions,
        residual_px=tuple(off for _ in positions),
        tolerance_px=0.5,
        corrections=1,
    )


@st.composite
def finding(draw: st.DrawFn) -> Step:
    target = draw(targets)
    return lambda world: world.with_target(target)


@st.composite
def planning(draw: st.DrawFn) -> Step:
    places, robots = draw(st.lists(points, min_size=1, max_size=4)), draw(st.booleans())
    edit, unseen = draw(st.none() | names), draw(st.sampled_from([(), ("t1",)]))

    def step(world: World) -> World:
        plan = plan_of(world, places, robots=robots)
        return world.with_plan(PlanNode(plan=plan, parent=world.current, edit=edit, unseen=unseen))

    return step


@st.composite
def sampling(draw: st.DrawFn) -> Step:
    found = draw(st.lists(points, max_size=4))
    return lambda world: world.with_sample(found)[0]


@st.composite
def deploying(draw: st.DrawFn) -> Step:
    which, off = draw(st.integers(0, 9)), draw(numbers)

    def step(world: World) -> World:
        if not world.plans:
            return world
        name = list(world.plans)[which % len(world.plans)]
        return world.with_arrival(name, arrival_of(world.plans[name].plan, off))

    return step


@st.composite
def having(draw: st.DrawFn, name: str, values: st.SearchStrategy[Any]) -> Step:
    value = draw(values)
    return lambda world: world.having(**{name: value})


steps: st.SearchStrategy[Step] = st.one_of(
    finding(),
    planning(),
    sampling(),
    deploying(),
    having("robots", poses),
    having("metres_per_pixel", st.none() | st.floats(0.01, 2)),
    having("pointed", st.lists(prompts, max_size=2).map(tuple)),
    having("doubted", st.none() | targets),
    having(
        "shown",
        st.lists(
            st.builds(ShownCandidate, id=names, label=names, box=st.just((1.0, 2.0, 3.5, 4.0)))
        ).map(tuple),
    ),
    having(
        "keep_out",
        st.lists(
            st.builds(
                KeepOut,
                id=st.sampled_from(["k1", "k2"]),
                outline=outlines(),
                reason=names,
                hard=st.booleans(),
            ),
            max_size=2,
            unique_by=lambda region: region.id,
        ).map(tuple),
    ),
)


def through_json(value: Any) -> Any:
    return json.loads(json.dumps(value))


def folded(world: World, changes: dict[str, Any]) -> World:
    return with_changes(world, through_json(changes))


def same(one: World, other: World) -> bool:
    """Equal, and with what goes by id in the same order."""
    orders = [[list(w.plans), list(w.arrivals), list(w.samples)] for w in (one, other)]
    return (
        one == other and one.version_of(BOTH) == other.version_of(BOTH) and orders[0] == orders[1]
    )


@given(st.lists(st.lists(steps, max_size=4), max_size=6))
def test_changes_written_as_json_fold_to_the_same_world(turns: list[list[Step]]) -> None:
    worlds = [EMPTY]
    for turn in turns:
        worlds.append(reduce(lambda world, step: step(world), turn, worlds[-1]))
    world = EMPTY
    for before, after in pairwise(worlds):
        changes = changes_since(after, before)
        world = folded(world, changes)
        assert same(world, after)
        assert (changes == {}) <= (before == after)
    written = [through_json(changes_since(b, a)) for a, b in pairwise(worlds)]
    assert same(with_changes(EMPTY, *written), worlds[-1])
    assert same(folded(EMPTY, changes_since(worlds[-1], EMPTY)), worlds[-1])
    assert same(folded(EMPTY, changes_since(worlds[-1], None)), worlds[-1])


@given(targets, st.lists(points, min_size=1, max_size=3))
def test_only_what_is_new_is_written(target: Target, places: list[tuple[float, float]]) -> None:
    first = EMPTY.with_target(target)
    plan = plan_of(first, places, robots=True)
    one = first.with_plan(PlanNode(plan=plan))
    sampled, name = one.with_sample(places)
    other = plan_of(first, [*places, (5.0, 5.0)], robots=False)
    two = sampled.with_plan(PlanNode(plan=other, parent=plan.id))
    assert changes_since(one, one) == {}
    assert set(changes_since(sampled, one)) == {"samples"}
    changes = changes_since(two, one)
    assert set(changes) - {"current"} == {"samples", "plans"}
    assert changes["plans"].keys() == {"items"}
    assert list(changes["plans"]["items"]) == [other.id]
    assert list(changes["samples"]["items"]) == [name]
    again = two.with_plan(two.plans[plan.id])
    changes = changes_since(again, two)
    assert changes["plans"] == {"ids": [other.id, plan.id], "items": {}}
    fewer = again.having(plans={other.id: again.plans[other.id]}, targets=())
    assert same(folded(again, changes_since(fewer, again)), fewer)


@given(st.lists(steps, min_size=1, max_size=6))
def test_no_step_changes_an_earlier_world(made: list[Step]) -> None:
    worlds = [EMPTY]
    written = [EMPTY.model_dump_json()]
    for step in made:
        worlds.append(step(worlds[-1]))
        written.append(worlds[-1].model_dump_json())
    assert [world.model_dump_json() for world in worlds] == written


@pytest.mark.parametrize(
    "changes",
    [
        {"targets": {"ids": ["t1"], "items": {}}},
        {"targets": {"ids": ["t1"], "items": {"t1": {"id": "t1"}}}},
        {"targets": [1]},
        {"plans": {"ids": []}},
        {"metres_per_pixel": "wide"},
        {"colour": 3},
        {"robots": [{"id": "1"}]},
    ],
)
def test_changes_that_nothing_wrote_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises((ValidationError, KeyError, TypeError)):
        with_changes(EMPTY, changes)


def box(x: float, name: str = "t1") -> Target:
    outline = make_outline([(x, 50), (x + 60, 50), (x + 60, 110), (x, 110)])
    return Target(
        id=name, label="box", box=outline.bounds, confidence=0.9, outline=outline, prompt="box"
    )


def test_the_version_follows_what_a_certificate_depends_on_and_nothing_else() -> None:
    world = EMPTY.with_target(box(20)).with_target(box(150, "t2"))
    region = KeepOut(id="k1", outline=box(90).outline, reason="wet paint")
    soft = region.model_copy(update={"hard": False})
    assert world.with_target(box(20)).version_of(BOTH) == world.version_of(BOTH)
    turned = make_outline([(80, 110), (20, 110), (20, 50), (80, 50)])
    assert world.with_target(box(20).model_copy(update={"outline": turned})).version_of(BOTH) == (
        world.version_of(BOTH)
    )
    for same_version in (
        world.having(targets=world.targets[::-1]),
        world.having(robots=(Pose("1", 3, 4),), keep_out=(soft,)),
        world.with_sample([(1, 2)])[0],
        world.with_target(box(20).model_copy(update={"label": "crate", "confidence": 0.1})),
        world.with_target(box(200, "t3")),
    ):
        assert same_version.version_of(BOTH) == world.version_of(BOTH)
    others = [
        world.with_target(box(20.001)),
        world.having(metres_per_pixel=0.1),
        world.having(metres_per_pixel=0.2),
        world.having(keep_out=(region,)),
        EMPTY,
        World.of(picture_from_array(np.full((200, 300, 3), 91, np.uint8)), targets=world.targets),
    ]
    versions = [world.version_of(BOTH), *(other.version_of(BOTH) for other in others)]
    assert len(set(versions)) == len(versions)


def test_plans_are_found_by_id_as_long_as_they_are_true() -> None:
    with pytest.raises(ToolError, match=r"no plan\. Plans: none yet") as caught:
        EMPTY.plan()
    assert caught.value.kind == "unknown_plan"
    world = EMPTY.with_target(box(20))
    first, second = (PlanNode(plan=plan_of(world, [p], robots=False)) for p in ((5, 5), (9, 9)))
    world = world.with_plan(first).with_plan(second)
    assert world.plan() == second
    assert world.plan(first.plan.id) == first
    world = world.with_plan(first)
    assert list(world.plans) == [second.plan.id, first.plan.id]
    assert world.current == first.plan.id
    with pytest.raises(ToolError, match=f"no plan 'p-x'. Plans: {second.plan.id}, ") as caught:
        world.plan("p-x")
    assert caught.value.kind == "unknown_plan"
    assert world.with_target(box(21)).plan() == first, "the plan is not about t1"
    moved = world.having(metres_per_pixel=0.1)
    with pytest.raises(ToolError, match="is void") as caught:
        moved.plan()
    assert caught.value.kind == "void_plan"
    assert moved.having(metres_per_pixel=None).plan() == first
    with pytest.raises(ToolError, match=r"no target 't9'\. Targets: t1") as caught:
        world.target("t9")
    assert caught.value.kind == "unknown_target"


def test_a_world_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        EMPTY.current = "p-1"  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.raises(InputError, match="0 metres per pixel"):
        World.of(PICTURE, metres_per_pixel=0)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"segmenter": "scissors"}, "scissors"),
        ({"detector": "eyes"}, "eyes"),
        ({"fleet": "ants"}, "ants"),
        ({"metres_per_pixel": -1}, "-1 metres per pixel"),
    ],
)
def test_what_a_person_fixed_is_checked_before_anything_is_done(
    settings: dict[str, Any], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        Context.of(PICTURE, Settings(**settings))


def test_a_scale_that_a_person_gives_is_the_worlds_from_then_on() -> None:
    assert Context.of(PICTURE, Settings(metres_per_pixel=0.5)).world.metres_per_pixel == 0.5
    world = World.of(PICTURE, metres_per_pixel=0.5)
    assert Context.of(PICTURE, Settings(), world).world is world
    assert Context.of(PICTURE, Settings(metres_per_pixel=2), world).world.metres_per_pixel == 2


def test_artefacts_in_memory_are_found_by_the_hash_of_their_content() -> None:
    artefacts = MemoryArtefacts()
    first, second = artefacts.put(b"one"), artefacts.put(b"two")
    assert artefacts.put(b"one") == first
    assert (artefacts.get(first), artefacts.get(second)) == (b"one", b"two")
    with pytest.raises(StorageError, match="no file 0000"):
        artefacts.get("0" * 64)
