"""Built-in tools that draw forms, equal chords, several rings and rings in holes."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import shapely
from formup.tools.errors import ToolError
from formup.tools.geometry.outline import FloatArray, Outline, make_outline
from formup.tools.perception.image import picture_from_array
from formup.tools.world import Target, World

if TYPE_CHECKING:
    from ..conftest import ToolCalls

Begin = Callable[..., "ToolCalls"]


@pytest.fixture
def work(tool_calls: Begin) -> "ToolCalls":
    """A picture of 300 x 240 px with a rectangle t1 that has a hole 40 px wide."""
    outline = make_outline(
        [(100, 80), (200, 80), (200, 160), (100, 160)],
        ([(130, 100), (170, 100), (170, 140), (130, 140)],),
    )
    return with_target(tool_calls, outline, (300, 240))


def with_target(
    tool_calls: Begin, outline: Outline, size: tuple[int, int], **settings: Any
) -> "ToolCalls":
    picture = picture_from_array(np.full((size[1], size[0], 3), 90, np.uint8))
    target = Target(
        id="t1",
        label="thing",
        box=outline.bounds,
        confidence=1.0,
        outline=outline,
        prompt="outline",
    )
    return tool_calls(picture, world=World.of(picture, targets=(target,)), **settings)


def sampled(work: "ToolCalls", name: str, **arguments: Any) -> FloatArray:
    return np.asarray(work.call(name, **arguments).data["positions"])


FORMS: list[dict[str, Any]] = [
    {"kind": "letters", "text": "HI", "box": (20, 20, 280, 220)},
    {"kind": "outlined_letters", "text": "Go!", "box": (20, 20, 280, 220)},
    {"kind": "star", "where": "on", "targets": ["t1"], "corners": 7},
    {"kind": "grid", "where": "left", "targets": ["t1"], "rows": 6},
    {"kind": "arc", "angles": (0, 90), "box": (10, 10, 200, 200)},
    {"kind": "polygon", "where": "around", "targets": ["t1"], "corners": 8},
    {"kind": "circle", "where": "on", "targets": ["t1"]},
    {"kind": "polyline", "points": [(10, 10), (60, 200), (250, 20)]},
    {"kind": "line", "where": "below", "targets": ["t1"]},
]


@pytest.mark.parametrize("form", FORMS, ids=lambda f: f["kind"])
def test_a_sampled_form_is_certified_as_the_form_it_is(
    work: "ToolCalls", form: dict[str, Any]
) -> None:
    sample = work.call("sample_shape", n=12, **form).data["sample"]
    shape = {k: v for k, v in form.items() if k != "targets"}
    group = {"relation": "shape", "targets": form.get("targets", []), "robots": 12, "shape": shape}
    plan = work.call("propose_formation", contract={"groups": [group]}, samples=[sample]).data
    assert plan["findings"] == []
    assert plan["certified"]


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ({"kind": "between", "targets": ["t1", "t2"], "rows": 2}, "rows cannot be used"),
        ({"kind": "star", "start": (1, 1), "box": (0, 0, 9, 9)}, "start cannot be used"),
        ({"kind": "circle"}, "either a box, or where"),
        ({"kind": "line"}, "needs start and end"),
        ({"kind": "star", "where": "on"}, "takes 1 target"),
        ({"kind": "arc", "angles": (50, 50), "box": (0, 0, 9, 9)}, "two angles that differ"),
        ({"kind": "letters", "text": "no!", "box": (0, 0, 9, 9)}, "'!'"),
        ({"kind": "outlined_letters", "text": "Ü", "box": (0, 0, 9, 9)}, "'Ü'"),
    ],
)
def test_forms_that_mean_nothing_are_refused(
    work: "ToolCalls", arguments: dict[str, Any], why: str
) -> None:
    with pytest.raises(ToolError, match=why):
        work.call("sample_shape", n=5, **arguments)


def test_chords_are_equal_around_and_along_a_side(work: "ToolCalls") -> None:
    ring = sampled(work, "sample_along_edges", target="t1", n=9, offset=20, chords=True)
    chords = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    assert chords.min() > 0.99 * chords.max()
    line = sampled(work, "sample_along_edges", target="t1", n=4, side="left", chords=True)
    assert np.ptp(np.linalg.norm(np.diff(line, axis=0), axis=1)) < 0.5


def test_rings_stand_one_behind_the_other_and_say_how_many_each(work: "ToolCalls") -> None:
    reply = work.call("sample_along_edges", target="t1", n=20, offset=12, rings=2, step=9).data
    counts = reply["robots_per_ring"]
    assert (len(counts), sum(counts)) == (2, 20)
    groups = [
        {"relation": "around", "targets": ["t1"], "robots": k, "clearance": [d - 1, d + 1]}
        for k, d in zip(counts, (12, 21), strict=True)
    ]
    plan = work.call(
        "propose_formation", contract={"groups": groups}, samples=[reply["sample"]]
    ).data
    assert plan["findings"] == []


def test_in_holes_robots_keep_off_the_edge(work: "ToolCalls") -> None:
    points = sampled(work, "sample_along_edges", target="t1", n=6, offset=8, holes=True)
    assert np.abs(points - (150, 120)).max(axis=1) == pytest.approx(12, abs=0.1)
    with pytest.raises(ToolError, match="do not fit in the holes of t1"):
        work.call("sample_along_edges", target="t1", n=6, offset=30, holes=True)
    with pytest.raises(ToolError, match="n, offset and step alone"):
        work.call("sample_along_edges", target="t1", n=6, holes=True, side="left")


@pytest.fixture
def beside_border(tool_calls: Begin) -> Begin:
    """A crate at the left border of 640 x 480 px, for robots of a radius."""
    outline = make_outline([(8, 150), (100, 150), (100, 300), (8, 300)])

    def made(radius: float) -> "ToolCalls":
        return with_target(tool_calls, outline, (640, 480), robot_radius=radius)

    return made


@pytest.mark.parametrize("rings", [1, 2, 3])
@pytest.mark.parametrize("radius", [0.0, 6.0])
def test_rings_that_the_border_cuts_keep_their_distance(
    beside_border: Begin, rings: int, radius: float
) -> None:
    place = beside_border(radius)
    points = sampled(
        place, "sample_along_edges", target="t1", n=18, rings=rings, offset=15.0, step=20.0
    )
    off = shapely.distance(place.world.target("t1").outline.filled, shapely.points(points))
    assert off.min() >= 15 + radius - 0.05
    assert len(points) == 18


def test_a_line_keeps_robots_apart_and_in_the_picture(beside_border: Begin) -> None:
    place = beside_border(20.0)
    with pytest.raises(ToolError, match=r"robots? fit"):
        place.call("sample_shape", kind="line", n=5, start=(0, 0), end=(40, 0))
    points = sampled(place, "sample_shape", kind="line", n=5, start=(0, 30), end=(639, 30))
    assert points[:, 0].min() >= 20
    assert points[:, 0].max() <= 619
    with pytest.raises(ToolError, match="takes no targets"):
        place.call("sample_shape", kind="line", n=2, start=(0, 9), end=(40, 9), targets=["t1"])


def test_on_the_outline_itself_there_are_no_rings(beside_border: Begin) -> None:
    with pytest.raises(ToolError, match="offset of 0"):
        beside_border(0.0).call("sample_along_edges", target="t1", n=9, rings=2, offset=0)
