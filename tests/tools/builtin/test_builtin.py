"""The tools by the names a model calls them: what they answer, and what they refuse."""

import asyncio
import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from formup.tools.builtin import TOOLS
from formup.tools.context import Context
from formup.tools.errors import ToolError
from formup.tools.perception.image import picture_from_array
from formup.tools.perception.target_prompt import TargetPrompt
from formup.tools.tool import ToolResult, tool
from formup.tools.world import World
from PIL import Image

if TYPE_CHECKING:
    from ..conftest import ToolCalls

NAMES = [
    "look",
    "locate_object",
    "segment",
    "derive_target",
    "describe_shape",
    "check_point",
    "sample_along_edges",
    "sample_inside",
    "sample_shape",
    "measure",
    "propose_formation",
    "edit_formation",
    "undo",
    "deploy",
    "ask_user",
    "report_impossible",
]
BOX = (55, 35, 125, 95)
Begin = Callable[..., "ToolCalls"]


@pytest.fixture
def work(tool_calls: Begin) -> "ToolCalls":
    """A red 60 x 50 rectangle at (60, 40) and a blue square at (150, 100), on grey."""
    pixels = np.full((140, 200, 3), 90, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    pixels[100:125, 150:175] = (40, 40, 220)
    made = tool_calls(picture_from_array(pixels))
    call(made, "segment", id="t1", label="red", box=BOX)
    call(made, "segment", id="t2", label="blue", box=(145, 95, 180, 130))
    return made


def call(work: "ToolCalls", name: str, **arguments: Any) -> dict[str, Any]:
    return work.call(name, **arguments).data


def contract(relation: str, robots: int, *targets: str, **more: Any) -> dict[str, Any]:
    return {"groups": [{"relation": relation, "targets": targets, "robots": robots, **more}]}


def test_names_are_the_published_ones() -> None:
    assert [t.name for t in TOOLS] == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_described(name: str) -> None:
    chosen = next(t for t in TOOLS if t.name == name)
    assert len(chosen.description) > 40
    for schema in chosen.schema.get("properties", {}).values():
        assert schema["description"]


def test_a_tool_without_descriptions_fails_at_import() -> None:
    def silent(context: Context, n: int) -> ToolResult:
        """Does something."""
        return ToolResult({})

    with pytest.raises(TypeError, match="'n'"):
        tool("read")(silent)


def test_ones_own_tool_in_five_lines(work: "ToolCalls") -> None:
    @tool("read")
    def count_targets(context: Context, above: float = 0.0) -> ToolResult:
        """Count the targets found.

        Args:
            above: only those with an area above this, square pixels.
        """
        areas = [t.outline.area for t in context.world.targets]
        return ToolResult({"count": sum(area > above for area in areas)})

    assert asyncio.run(count_targets.call(work.context, {"above": 1000})).data == {"count": 1}


def test_look_shows_the_picture_with_targets_and_plan(work: "ToolCalls") -> None:
    plan = call(work, "propose_formation", contract=contract("around", 6, "t1"))
    result = work.call("look", plan_id=plan["plan_id"])
    assert [t["id"] for t in result.data["targets"]] == ["t1", "t2"]
    with Image.open(io.BytesIO(result.images[0])) as image:
        assert image.format == "JPEG"


def things() -> Any:
    """A red box, a large blue disc and a small one on grey."""
    pixels = np.full((240, 320, 3), 90, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    y, x = np.ogrid[:240, :320]
    pixels[(x - 230) ** 2 + (y - 70) ** 2 < 40**2] = (40, 60, 200)
    pixels[(x - 100) ** 2 + (y - 180) ** 2 < 20**2] = (40, 60, 200)
    return pixels


@pytest.fixture
def painted(tool_calls: Begin) -> "ToolCalls":
    return tool_calls(picture_from_array(things()))


def test_locate_object_measures_what_was_pointed_at(tool_calls: Begin) -> None:
    picture = picture_from_array(things())
    pointed = (TargetPrompt(points=((90, 65),)),)
    work = tool_calls(picture, world=World.of(picture, pointed=pointed))
    (found,) = call(work, "locate_object")["targets"]
    assert found["id"] == "t1"
    assert found["area_px"] == pytest.approx(3000, rel=0.1)
    assert [t.id for t in work.world.targets] == ["t1"]


def test_locate_object_lists_all_that_stands_out(painted: "ToolCalls") -> None:
    found = call(painted, "locate_object")
    assert found["things"] == 3
    seen = {(c["label"], tuple(c["box"])) for c in found["candidates"]}
    assert {label for label, _ in seen} == {"red rectangle", "blue circle"}
    (box,) = (box for label, box in seen if label == "red rectangle")
    assert box == pytest.approx((60, 40, 120, 90), abs=3)


def test_locate_object_decides_words_on_measures_and_says_the_numbers(
    painted: "ToolCalls",
) -> None:
    query = {"colours": ["blue"], "picks": [{"by": "smallest"}]}
    found = call(painted, "locate_object", query=query)
    (only,) = found["candidates"]
    assert found["settled"] is True
    assert only["box"] == pytest.approx([80, 160, 120, 200], abs=3)
    assert any("area" in r and "px" in r for r in only["reasons"])
    both = call(painted, "locate_object", query={"shapes": ["circle"]})
    assert both["settled"] is False
    assert len(both["candidates"]) == 2
    none = call(painted, "locate_object", query={"colours": ["purple"]})
    assert none["candidates"] == []
    assert "none of 3 things is purple" in none["lacking"]
    assert none["absent"] is True


def test_a_colour_that_some_thing_shows_a_little_of_is_not_absent(tool_calls: Begin) -> None:
    pixels = things()
    pixels[40:90, 60:68] = (240, 220, 30)  # a yellow stripe on the red box
    work = tool_calls(picture_from_array(pixels))
    found = call(work, "locate_object", query={"colours": ["yellow"]})
    assert found["candidates"] == []
    assert found["absent"] is False


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ({"colours": ["crimson"]}, "crimson|colours"),
        ({"picks": [{"by": "odd", "place": 2}]}, "odd has no place 2"),
        ({"relations": [{"kind": "between", "things": ["c1"]}]}, "two other things"),
        ({"relations": [{"kind": "left_of", "things": ["c9"]}]}, "no candidate c9"),
    ],
)
def test_locate_object_says_what_is_wrong_with_a_query(
    painted: "ToolCalls", query: dict[str, Any], words: str
) -> None:
    with pytest.raises(ToolError, match=words):
        call(painted, "locate_object", query=query)


def test_a_candidate_is_a_target_by_its_id(painted: "ToolCalls") -> None:
    query = {"colours": ["red"]}
    (red,) = call(painted, "locate_object", query=query)["candidates"]
    data = call(painted, "segment", id="t1", candidate=red["id"])
    assert data["area_px"] == pytest.approx(3000, rel=0.05)
    with pytest.raises(ToolError, match="no candidate 'c99'"):
        call(painted, "segment", id="t1", candidate="c99")


def test_look_numbers_the_candidates(painted: "ToolCalls") -> None:
    shown = call(painted, "look", candidates=True)
    assert [c["id"] for c in shown["candidates"]] == ["c1", "c2", "c3"]
    assert call(painted, "look")["candidates"] == []


@pytest.mark.parametrize(
    "how",
    [
        {"box": BOX},
        {"points": [(90, 65)]},
        {"outline": [(58, 41), (121, 38), (122, 92), (57, 88)]},
    ],
)
def test_segment_measures_the_thing_pointed_at(work: "ToolCalls", how: dict[str, Any]) -> None:
    data = call(work, "segment", id="t1", **how)
    assert data["area_px"] == pytest.approx(3000, rel=0.1)
    assert data["confidence"] > 0.6
    assert data["parts"]


def test_segment_below_the_threshold_says_the_papers_sentence(work: "ToolCalls") -> None:
    work.fix(threshold=1.0)
    with pytest.raises(ToolError, match=r"Insufficient segmentation accuracy.*1\.00.*outline"):
        call(work, "segment", id="t3", box=BOX)
    assert "t3" not in {t.id for t in work.world.targets}


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({}, "give a candidate, a text, a box, points or an outline"),
        ({"box": (60, 40, 50, 90)}, "inverted"),
        ({"box": (260, 40, 350, 90)}, "outside the picture"),
        ({"points": [(900, 4)]}, "outside the picture"),
        (
            {"box": BOX, "outline": [(0, 0), (9, 0), (9, 9)]},
            "give one of candidate, text, box and outline",
        ),
        ({"candidate": "c1", "points": [(9, 9)]}, "a candidate takes no points"),
        ({"id": "car", "box": BOX}, "id"),
    ],
)
def test_segment_refuses_what_points_nowhere(
    work: "ToolCalls", how: dict[str, Any], words: str
) -> None:
    with pytest.raises(ToolError, match=words):
        call(work, "segment", **how)


def test_descriptors(work: "ToolCalls") -> None:
    edges = call(work, "describe_shape", target="t1")
    assert edges["kind"] == "polygonal"
    assert len(edges["corners"]) == 4
    assert len(edges["edges"]) >= 4
    assert "vertices" not in edges
    both = call(work, "describe_shape", target="t1", descriptor="edges+vertices")
    assert len(both["vertices"]) == len(both["edges"])
    matrix = call(work, "describe_shape", target="t1", descriptor="matrix")["matrix"]
    assert max(len(matrix["rows"]), len(matrix["rows"][0])) == 32
    ones = sum(row.count("1") for row in matrix["rows"])
    assert ones * matrix["cell_px"] ** 2 == pytest.approx(edges["area_px"], rel=0.05)


def test_check_point(work: "ToolCalls") -> None:
    data = call(work, "check_point", target="t1", points=[(90, 65), (20, 65), (59.5, 65)])
    where = [p["where"] for p in data["points"]]
    assert where[:2] == ["inside", "outside"]
    inside, outside, _ = (p["signed_distance_px"] for p in data["points"])
    assert inside == pytest.approx(-25, abs=2)
    assert outside == pytest.approx(40, abs=2)


def test_samples_are_kept_and_can_be_proposed(work: "ToolCalls") -> None:
    ring = call(work, "sample_along_edges", target="t1", n=8)
    proposed = call(
        work, "propose_formation", contract=contract("around", 8, "t1"), samples=[ring["sample"]]
    )
    assert proposed["certified"], proposed["findings"]
    inside = call(work, "sample_inside", target="t1", n=5)
    corners = call(work, "sample_along_edges", target="t1", n=4, at="corners")
    left = call(work, "sample_along_edges", target="t1", n=3, side="left")
    assert all(x < 60 for x, _ in left["positions"])
    assert [ring["sample"], inside["sample"], corners["sample"]] == ["s1", "s2", "s3"]
    with pytest.raises(ToolError, match=r"'s9'.*s1, s2"):
        call(work, "propose_formation", contract=contract("around", 8, "t1"), samples=["s9"])


def test_shapes(work: "ToolCalls") -> None:
    line = call(work, "sample_shape", kind="line", n=3, start=(10, 10), end=(50, 10))
    assert line["positions"] == [[10, 10], [30, 10], [50, 10]]
    between = call(work, "sample_shape", kind="between", n=2, targets=["t1", "t2"])
    assert len(between["positions"]) == 2
    centre = call(work, "sample_shape", kind="centre", n=1, targets=["t1"])
    assert centre["positions"][0] == pytest.approx([89.5, 64.5], abs=1.5)
    with pytest.raises(ToolError, match="start and end"):
        call(work, "sample_shape", kind="line", n=3)
    with pytest.raises(ToolError, match=r"between takes 2 target"):
        call(work, "sample_shape", kind="between", n=3, targets=["t1"])


def test_measure(work: "ToolCalls") -> None:
    data = call(work, "measure", a="t1", b="t2")
    assert data["nearest_px"] == pytest.approx(np.hypot(30.5, 10.5), abs=3)
    points = call(work, "measure", a=(0, 0), b=(3, 4))
    assert points["centres_px"] == 5
    assert points["direction_degrees"] == pytest.approx(53.1)


def test_one_call_goes_from_pointing_to_a_certified_plan(tool_calls: Begin) -> None:
    pixels = np.full((140, 200, 3), 90, np.uint8)
    pixels[40:90, 60:120] = (200, 40, 40)
    work = tool_calls(picture_from_array(pixels), robots=4)
    data = call(
        work,
        "propose_formation",
        contract=contract("corners", 4, "t1"),
        targets=[{"id": "t1", "box": BOX}],
    )
    assert data["certified"]
    assert call(work, "deploy", plan_id=data["plan_id"])["arrived"]


def test_all_violations_come_back_at_once(work: "ToolCalls") -> None:
    bad = [(90, 65), (-5, 10), (300, 10), (90, 66), (20, 65), (160, 65)]
    data = call(work, "propose_formation", contract=contract("around", 6, "t1"), positions=bad)
    assert not data["certified"]
    text = " ".join(data["findings"])
    for word in ("Robot 1 stands on t1", "Robot 2 is 5.0 px outside", "Robot 3", "Robot 4"):
        assert word in text
    with pytest.raises(ToolError, match="not certified"):
        call(work, "deploy", plan_id=data["plan_id"])


def test_what_the_person_fixed_is_held_to(work: "ToolCalls") -> None:
    work.fix(robots=6, robot_radius=4, clearance=15)
    with pytest.raises(ToolError, match="asked for 6 robots"):
        call(work, "propose_formation", contract=contract("around", 5, "t1"))
    call(work, "propose_formation", contract=contract("around", 6, "t1"))
    (node,) = work.world.plans.values()
    plan = node.plan
    assert plan.formation.contract.robot_radius == 4
    assert plan.formation.contract.groups[0].clearance == (14, 16)
    work.fix(may_deploy=False)
    with pytest.raises(ToolError, match="plan only"):
        call(work, "deploy", plan_id=plan.id)


def test_a_changed_scene_voids_a_plan(work: "ToolCalls") -> None:
    plan = call(work, "propose_formation", contract=contract("around", 6, "t1"))["plan_id"]
    call(work, "segment", id="t1", outline=[(62, 42), (118, 42), (118, 88), (62, 88)])
    with pytest.raises(ToolError, match="is void: the picture or its scale is another"):
        call(work, "deploy", plan_id=plan)


def test_questions_and_impossibilities(work: "ToolCalls") -> None:
    asked = call(work, "ask_user", question="Which?", candidates=["t1", "t2"])
    assert [c["id"] for c in asked["candidates"]] == ["t1", "t2"]
    with pytest.raises(ToolError, match="'t9'"):
        call(work, "ask_user", question="Which?", candidates=["t9"])
    said = call(work, "report_impossible", reason="too few", robots_needed=9)
    assert said == {"reason": "too few", "robots_needed": 9, "plan_id": None}
    with pytest.raises(ToolError, match="'p-1'"):
        call(work, "report_impossible", reason="x", plan_id="p-1")
