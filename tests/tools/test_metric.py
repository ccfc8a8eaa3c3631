"""A scale of the picture: what tools take, say and keep, and that a certificate depends on it."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from formup.agent.agent import Agent
from formup.agent.first_message import read_task, task_text
from formup.agent.session import load_run
from formup.tools.context import Settings
from formup.tools.draw import draw_plan
from formup.tools.draw.scale_bar import length_label, round_metres
from formup.tools.errors import InputError, ToolError
from formup.tools.formation.units import in_metres
from formup.tools.perception.image import load_picture, picture_from_array
from formup.tools.store import StoredWorld, picture_of, read_world
from formup.tools.world import World
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

if TYPE_CHECKING:
    from .conftest import ToolCalls

SCALE = 0.05
Begin = Callable[..., "ToolCalls"]
TARGET = {"id": "t1", "label": "the box", "box": [75, 65, 145, 125]}


def pixels() -> Any:
    """A red 60 x 50 rectangle at (80, 70) on grey: 3 x 2.5 m."""
    made = np.full((200, 240, 3), 90, np.uint8)
    made[70:120, 80:140] = (200, 40, 40)
    return made


@pytest.fixture
def begin(tool_calls: Begin) -> Begin:
    """Calls on that picture, with a scale unless it is given as None."""

    def made(words: str = "", scale: float | None = SCALE, **more: Any) -> "ToolCalls":
        return tool_calls(picture_from_array(pixels()), words, metres_per_pixel=scale, **more)

    return made


def answer(work: "ToolCalls", name: str, **arguments: Any) -> dict[str, Any]:
    return work.call(name, **arguments).data


def propose(work: "ToolCalls", more: dict[str, Any], **group: Any) -> dict[str, Any]:
    given = {"relation": "around", "targets": ["t1"], "robots": 6} | group
    stated = {"groups": [given]} | more
    return answer(work, "propose_formation", contract=stated, targets=[TARGET])


def test_metres_and_their_pixels_make_the_same_plan(begin: Begin) -> None:
    plans = [
        propose(begin(), {"unit": unit, "robot_radius": 4 * f}, clearance=[20 * f, 22 * f])
        for unit, f in (("m", SCALE), ("px", 1))
    ]
    assert plans[0] == plans[1]
    data = plans[0]
    assert data["certified"]
    assert data["metres_per_pixel"] == SCALE
    assert 1 <= data["measures"]["min_clearance_m"] <= data["measures"]["max_clearance_m"] <= 1.1
    px = data["measures"]["min_clearance_px"]
    assert data["measures"]["min_clearance_m"] == in_metres(px, SCALE)


def test_a_length_without_a_unit_and_metres_without_a_scale_are_refused(begin: Begin) -> None:
    with pytest.raises(ToolError, match='"m" or "px"'):
        propose(begin(), {}, clearance=[1, 1.1])
    with pytest.raises(ToolError, match=r"no scale.*ask the person"):
        propose(begin(scale=None), {"unit": "m"}, clearance=[1, 1.1])
    assert propose(begin(), {})["certified"]


def test_findings_and_refusals_tell_metres(begin: Begin) -> None:
    group = {"relation": "around", "targets": ["t1"], "robots": 2, "clearance": [1, 1.1]}
    given = {"targets": [TARGET], "positions": [[40, 90], [180, 95]]}
    contract = {"groups": [group], "unit": "m"}
    data = answer(begin(), "propose_formation", contract=contract, **given)
    assert not data["certified"]
    assert re.search(r"is [12]\.\d{3} m \(\d\d\.\d px\) from t1; 1\.100 m \(22\.0 px\)", str(data))
    with pytest.raises(ToolError, match=r"only \d+ robots? fits?: the .* m \(\d+ px\)"):
        propose(begin(), {"unit": "m"}, min_spacing=5)
    contract = {"groups": [group | {"clearance": [20, 22]}]}
    plain = answer(begin(scale=None), "propose_formation", contract=contract, **given)
    assert [re.sub(r"[0-9.]+ m \((.+?)\)", r"\1", f) for f in data["findings"]] == plain["findings"]
    assert len(plain["findings"]) > 1


def test_a_named_length_that_the_contract_has_not_is_doubted(begin: Begin) -> None:
    words = "Surround the box, 1 m from it; the robots are 40 cm across"
    right = {"unit": "m", "robot_radius": 0.2}
    assert propose(begin(words), right, clearance=[1, 1.05])["certified"]
    in_px = {"unit": "px", "robot_radius": 4}
    assert propose(begin(words), in_px, clearance=[20, 21])["certified"]
    for more, clearance in (({"unit": "px", "robot_radius": 4}, [1, 1.05]), (right, [20, 21])):
        with pytest.raises(ToolError, match="names 1 m, which is no length"):
            propose(begin(words), more, clearance=clearance)
    with pytest.raises(ToolError, match=r"40 cm across, but robot_radius is 0\.400 m \(8\.0 px\)"):
        propose(begin(words), {"unit": "m", "robot_radius": 0.4}, clearance=[1, 1.05])
    with pytest.raises(ToolError, match="A doubt"):
        propose(begin(words), right)
    read = right | {"reading": "the metre is another thing's"}
    with pytest.raises(ToolError, match="A doubt"):
        propose(begin(words), read)  # an answer before the doubt
    assert propose(begin(words, clearance=20.0, robot_radius=4.0), {})["certified"]
    assert propose(begin(words, scale=None), {})["certified"]


def test_measuring_tools_tell_metres_beside_pixels(begin: Begin) -> None:
    work = begin()
    propose(work, {})
    shape = answer(work, "describe_shape", target="t1")
    assert (shape["length_m"], shape["width_m"]) == (
        in_metres(shape["length_px"], SCALE),
        in_metres(shape["width_px"], SCALE),
    )
    assert shape["area_m2"] == pytest.approx(shape["area_px"] * SCALE**2, abs=0.01)
    far = answer(work, "measure", a="t1", b=[10, 90])
    assert far["nearest_m"] == pytest.approx(far["nearest_px"] * SCALE, abs=1e-3)
    (point,) = answer(work, "check_point", target="t1", points=[[10, 90]])["points"]
    assert point["signed_distance_m"] == far["nearest_m"]
    plain = begin(scale=None)
    propose(plain, {})
    assert "_m" not in " ".join(answer(plain, "describe_shape", target="t1"))


def test_samples_take_metres(begin: Begin) -> None:
    work = begin()
    propose(work, {})
    metric = answer(work, "sample_along_edges", target="t1", n=6, offset=1, unit="m")
    plain = answer(work, "sample_along_edges", target="t1", n=6, offset=20, unit="px")
    assert metric["positions"] == plain["positions"]
    metric = answer(work, "sample_inside", target="t1", n=3, margin=0.25, unit="m")
    assert (
        metric["positions"]
        == (answer(work, "sample_inside", target="t1", n=3, margin=5, unit="px")["positions"])
    )
    with pytest.raises(ToolError, match="unit"):
        answer(work, "sample_inside", target="t1", n=3, margin=5)


def test_the_scale_is_part_of_what_is_certified_and_is_kept(
    tool_calls: Begin, tmp_path: Path
) -> None:
    Image.fromarray(pixels()).save(tmp_path / "box.png")
    picture = load_picture(tmp_path / "box.png")
    work = tool_calls(picture, metres_per_pixel=SCALE)
    plan = propose(work, {"unit": "m"}, clearance=[1, 1.1])["plan_id"]
    path = tmp_path / "state.json"
    path.write_bytes(StoredWorld(picture=str(picture.path), world=work.world).to_bytes())
    stored = read_world(path)
    back = tool_calls(picture_of(stored, path), world=stored.world)
    assert back.world.metres_per_pixel == SCALE
    assert answer(back, "deploy", plan_id=plan)["arrived"]
    other = tool_calls(picture, world=stored.world, metres_per_pixel=0.1)
    with pytest.raises(ToolError, match="or its scale is another"):
        answer(other, "deploy", plan_id=plan)
    assert work.world.having(metres_per_pixel=None).is_void(work.world.plans[plan].plan)
    with pytest.raises(InputError, match="-2 metres per pixel"):
        tool_calls(picture, metres_per_pixel=-2)
    with pytest.raises(InputError, match="-2 metres per pixel"):
        World.of(picture, metres_per_pixel=-2)


def test_the_first_message_says_the_scale_only_where_there_is_one(begin: Begin) -> None:
    text = task_text(begin("Go").context)
    assert "\nMetres per pixel: 0.05\n" in text
    assert read_task(text).metres_per_pixel == SCALE
    plain = task_text(begin("Go", scale=None).context)
    assert plain == text.replace("Metres per pixel: 0.05\n", "")
    assert read_task(plain).metres_per_pixel is None


def test_a_run_in_metres_is_reported_in_both_and_goes_on_in_another_process(
    tmp_path: Path,
) -> None:
    Image.fromarray(pixels()).save(tmp_path / "box.png")
    picture, trace = load_picture(tmp_path / "box.png"), tmp_path / "run.jsonl"
    words = "Ring the red thing with robots 40 cm wide, 1 m away and at least 50 cm apart"
    agent = Agent()
    asked = agent.run(picture, words, settings=Settings(metres_per_pixel=SCALE), trace=trace)
    assert asked.report.status == "question"
    report = agent.resume(load_run(trace), answer="7").report
    assert report.status == "deployed", report.message
    assert report.contract is not None and report.positions is not None
    (group,) = report.contract.groups
    assert group.clearance == (20, 21)
    assert group.min_spacing == 10
    assert (report.contract.robot_radius, report.contract.unit) == (4, "px")
    metric = report.metric
    assert metric is not None
    assert metric["metres_per_pixel"] == SCALE
    assert np.allclose(metric["positions"], np.asarray(report.positions) * SCALE, atol=1e-3)
    assert len(metric["observed"]) == len(metric["residual"]) == 7
    assert 1 <= metric["measures"]["min_clearance_m"] <= 1.05
    assert " m (" in report.message
    assert load_run(trace).report.metric == metric


def test_without_a_scale_metric_words_are_refused_with_what_would_do() -> None:
    words = "Ring the red thing with 6 robots, 1 m away"
    report = Agent().run(picture_from_array(pixels()), words).report
    assert report.status == "question"
    assert "1 m" in report.message
    assert "Say it in px" in report.message and "metres per pixel" in report.message
    assert report.metric is None


@given(st.floats(1e-5, 1e5))
def test_scale_bars_have_round_lengths(longest: float) -> None:
    metres = round_metres(longest)
    assert longest / 2.5 <= metres * (1 + 1e-6)
    assert metres <= longest * (1 + 1e-6)
    number, _, unit = length_label(metres).partition(" ")
    size = {"km": 1e3, "m": 1.0, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6}[unit]
    assert float(number) * size == pytest.approx(metres, rel=1e-5)
    assert number.strip("0.")[0] in "125"


def test_a_drawn_plan_has_a_scale_bar_of_the_length_it_says(begin: Begin) -> None:
    work = begin()
    propose(work, {})
    picture, plan = work.context.picture, work.world.plan().plan
    drawn = np.asarray(draw_plan(picture, work.world, plan, "")).astype(int)
    world = work.world.having(metres_per_pixel=None)
    plain = np.asarray(draw_plan(picture, world, plan, "")).astype(int)
    assert drawn.shape == plain.shape
    bright = (drawn[:, :, 0] > 230) & (np.abs(drawn - plain).sum(axis=2) > 300)
    rows = np.flatnonzero(bright.sum(axis=1) > 100)
    columns = np.flatnonzero(bright[rows].all(axis=0))
    width = drawn.shape[1] / picture.width
    runs = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    assert max(map(len, runs)) == pytest.approx(2 / SCALE * width, abs=3)  # 2 m of 12
