"""Suites: their format, their pictures, and every task of every one against a right answer."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import yaml
from formup.evals.grading.attempts import Attempt, grade_attempt, grade_goals
from formup.evals.grading.policies import POLICIES, scores
from formup.evals.grading.reference_answers import reference
from formup.evals.scenes.paint import draw
from formup.evals.scenes.stories import family_of, story_of
from formup.evals.tasks.annotations import PHOTOS
from formup.evals.tasks.heldout_ledger import look
from formup.evals.tasks.recipes.inscribed import inscribed
from formup.evals.tasks.recipes.styled import STYLES
from formup.evals.tasks.rendered_pictures import render
from formup.evals.tasks.suites import load_suite, schema, seeds_of, shipped, write_suite
from formup.evals.tasks.task import Drawing, Suite, Task
from formup.tools.errors import InputError
from formup.tools.formation.quantities import Quantity, quantities_in
from formup.tools.geometry.cages.cages import cage
from shapely.geometry import Point

SPLIT = {"formation-dev": ("train", "dev", "test")}
PARTS = [(name, split) for name in shipped() for split in SPLIT.get(name, ("dev",))]
CEILINGS = {"pile": 0.1, "scatter": 0.3, "boundary": 0.1, "circle": 0.35, "line": 0.35}
"""Mean GCR over a suite's tasks for more than one robot that a policy may reach."""
LUCKY = 0.02
"""Share of tasks for more than one robot that a policy may solve by chance."""
STRIDE = 3
"""Of more than 20 tasks every third is tried by the policies; all are held to a right answer."""
FOLDER = Path(__file__).parents[3] / "evals" / "tasks"


def lengths_of(task: Task) -> tuple[list[Quantity], list[Quantity]]:
    """The lengths that a task's words name: how far across robots are, and the others."""
    text = task.instruction
    lengths = [q for q in quantities_in(text) if q.is_length]
    across = [q for q in lengths if re.match(r" (?:across|wide|in diameter)", text[q.end :])]
    return across, [q for q in lengths if q not in across]


@cache
def loaded(name: str, split: str = "dev") -> Suite:
    return load_suite(name, split)


def write(folder: Path, tasks: list[dict[str, Any]], **more: Any) -> str:
    content = {"name": "mine", "description": "Mine.", "tasks": tasks, **more}
    (folder / "suite.yaml").write_text(yaml.safe_dump(content))
    return str(folder)


@pytest.mark.parametrize(("name", "split"), PARTS)
def test_a_right_answer_scores_1_and_no_understanding_little(name: str, split: str) -> None:
    tasks = [task for task in loaded(name, split).tasks if task.goals]
    wrong: list[str] = []
    for task in tasks:
        graded = grade_goals(task.goals, np.concatenate([reference(goal) for goal in task.goals]))
        if not (graded.sr and graded.strict and graded.gcr == 1):
            wrong.append(f"{task.id}: {graded.feedback}")
    assert wrong == []
    teams = [task for task in tasks if sum(goal.robots for goal in task.goals) > 1]
    some = teams[:: STRIDE if len(teams) > 20 else 1]
    for policy in POLICIES if some else ():
        found = [scores(policy, task.goals, 1) for task in some]
        assert np.mean([gcr for _, gcr in found]) <= CEILINGS[policy]
        lucky = LUCKY * len(some) if len(some) > 50 else float(len(some) > 20)
        assert sum(sr for sr, _ in found) <= lucky


def test_what_ships() -> None:
    assert shipped() == [
        "ablations",
        "dialogues",
        "exact",
        "formation-dev",
        "formup-hard",
        "frontier",
        "infeasible",
        "injection",
        "many",
        "photos",
        "photos-added",
        "scenes",
        "smoke",
        "zerocap15",
    ]
    jsonschema.Draft202012Validator.check_schema(schema())
    for path in FOLDER.glob("*.yaml"):
        assert yaml.safe_load(path.read_text("utf-8"))["name"] == path.stem


def test_seeds_may_be_others() -> None:
    assert [task.id for task in load_suite("scenes", seeds="57-58").tasks] == [
        "scene_000057_t1",
        "scene_000058_t1",
    ]
    assert len(load_suite("infeasible", seeds="7").tasks) == 1


def test_the_papers_grid() -> None:
    tasks = loaded("zerocap15").tasks
    assert len(tasks) == 15
    assert sum(isinstance(task.picture, Drawing) for task in tasks) == 10
    assert len({(task.category, task.setup) for task in tasks}) == 9
    for counts in ([task.category for task in tasks], [task.setup for task in tasks]):
        assert {counts.count(value) for value in counts} == {5}


def test_the_development_suite_is_broad_and_split_by_family() -> None:
    train = loaded("formation-dev", "train").tasks  # the smallest; the others are made alike
    robots = [task.robots or 0 for task in train]
    assert min(robots) == 3
    assert 50 < max(robots) <= 64
    assert {task.style for task in train} == set(STYLES)
    assert {task.family for task in train} == {"warehouse"}
    assert sum("px" in task.instruction for task in train) >= 12
    assert len({(task.category, task.setup) for task in train}) == 9
    content = yaml.safe_load((FOLDER / "formation-dev.yaml").read_text("utf-8"))
    drawn = [family_of(seed).name for seed in seeds_of(content["tasks"][0]["scenes"], FOLDER)]
    dev = sum(name in content["splits"]["dev"] for name in drawn) + 30 + 12
    assert dev >= 150
    families = [name for names in content["splits"].values() for name in names]
    assert sorted(families) == sorted({*drawn, "photos"})


def test_the_frontier_has_what_it_says() -> None:
    tasks = loaded("frontier").tasks
    cages = [task for task in tasks if task.goals[0].success["where"] == "cage"]
    others = [task for task in tasks if task not in cages]
    assert min(task.robots or 0 for task in others) >= 20
    assert max(task.robots or 0 for task in others) > 80
    assert sum(len(task.goals) > 1 for task in tasks) == 12 + 4
    assert len(cages) == 12
    assert any(task.goals[0].target.holes for task in tasks)
    assert sum(bool(task.goals[0].success.get("closed")) for task in tasks) == 12 + 4
    metric = [task for task in tasks if task.metres_per_pixel]
    assert len(metric) == 16
    for task in metric:
        across, others = lengths_of(task)
        assert len(across) == 1
        assert others
        assert "px" not in task.instruction


def test_metric_tasks_name_metres_and_are_graded_in_px() -> None:
    tasks = [t for split in SPLIT["formation-dev"] for t in loaded("formation-dev", split).tasks]
    metric = [task for task in tasks if task.metres_per_pixel]
    assert len(metric) == 36
    assert {task.family for task in metric} == {task.family for task in tasks}
    sized = 0
    for task in metric:
        across, others = lengths_of(task)
        assert all(length.kind == "m" for length in (*across, *others))
        assert others
        sized += bool(across)
        (goal,) = task.goals
        assert not [name for name in goal.success if name.endswith("_m")]
        if "band_px" in goal.success:
            assert task.metres_per_pixel is not None
            far = (others[0].least + sum(q.least for q in across) / 2) / task.metres_per_pixel
            assert sum(goal.success["band_px"]) / 2 == pytest.approx(far, abs=0.6)
    assert sized >= 15


def test_robots_whose_named_size_is_left_out_stand_too_near() -> None:
    for task in loaded("frontier").tasks:
        goal = task.goals[0]
        if not task.metres_per_pixel or "band_px" not in goal.success:
            continue
        radius = lengths_of(task)[0][0].least / task.metres_per_pixel / 2
        low, high = goal.success["band_px"]
        assert radius > (high - low) / 2
        near = replace(goal, success=goal.success | {"band_px": [low - radius, high - radius]})
        assert grade_goals([near], reference(near)).sr
        assert not grade_goals([goal], reference(near)).sr


@pytest.mark.parametrize("extra", [{}, {"metres_per_pixel": 0.1, "band": True}])
def test_metres_in_a_rule_take_a_scale_and_stand_alone(
    tmp_path: Path, extra: dict[str, Any]
) -> None:
    entries = json.loads((PHOTOS / "metric.json").read_text("utf-8"))[:1]
    (tmp_path / "images").symlink_to(PHOTOS / "images")
    folder = write(tmp_path, [{"pictures": entries, "metres_per_pixel": 0.2}])
    (task,) = load_suite(folder).tasks
    rule = entries[0]["tasks"][0]["success"]
    assert task.goals[0].success["band_px"] == pytest.approx([v / 0.2 for v in rule["band_m"]])
    entries[0].pop("metres_per_pixel")
    if extra:
        entries[0]["metres_per_pixel"] = 0.1
        rule["band_px"] = [1, 2]
    (tmp_path / "annotations.json").write_text(json.dumps(entries))
    with pytest.raises(InputError, match="band_m" if not extra else "breaks the photos format"):
        load_suite(str(tmp_path / "annotations.json"))


def test_a_right_escape_proof_cage_has_2_px_to_spare_and_most_hold_what_has_recesses() -> None:
    tasks = loaded("frontier").tasks
    cages = [t.goals[0] for t in tasks if t.goals[0].success["where"] == "cage"]
    for goal in cages:
        smaller = goal.target.outline.filled.buffer(-2)
        assert cage(smaller, reference(goal), escapes=False).state == "caged", goal.target.name
    hulls = [goal.target.outline.filled.convex_hull.area for goal in cages]
    filled = [goal.target.outline.filled.area for goal in cages]
    assert sum(area < 0.8 * hull for area, hull in zip(filled, hulls, strict=True)) == 9


def test_where_nothing_is_to_be_placed_moving_is_wrong() -> None:
    for task in loaded("infeasible").tasks:
        assert "deployed" not in task.expects
        asked = Attempt(task.expects[0], declined=True)
        assert grade_attempt(task.goals, task.expects, asked).sr
        words = grade_attempt(task.goals, task.expects, Attempt(task.expects[0], message="No."))
        assert not words.sr
        assert "in words alone" in words.feedback
        moved = Attempt(task.expects[0], [(1, 1)], [(1, 1)], declined=True)
        assert "moved" in grade_attempt(task.goals, task.expects, moved).feedback


def test_words_in_a_picture_stand_beside_the_thing_meant() -> None:
    for seed in (50004, 50011, 50021):
        plain, story = draw(story_of(seed).scene), story_of(seed)
        written = Drawing(seed, inscribed(seed)["inscription"]).image()
        changed = (np.asarray(plain) != np.asarray(written)).any(axis=2)
        assert changed.sum() > 200
        rows, columns = np.nonzero(changed)
        touched = [
            story.target.polygon.distance(Point(x, y))
            for x, y in zip(columns.tolist(), rows.tolist(), strict=True)
        ]
        assert min(touched) > 0


def test_pictures_are_drawn_once_and_hashed_by_their_pixels(tmp_path: Path) -> None:
    suite = loaded("zerocap15")
    some = Suite("some", "", suite.tasks[4:7])
    first = render(some.tasks, tmp_path / "a")
    again = render(some.tasks, tmp_path / "b")
    pixels = {name: picture.pixels for name, picture in first.items()}
    assert pixels == {name: picture.pixels for name, picture in again.items()}
    assert some.sha256(pixels) == some.sha256(dict(reversed(pixels.items())))
    assert some.sha256(pixels) != some.sha256(dict.fromkeys(pixels, "0"))
    assert some.sha256(pixels) != Suite("other", "", some.tasks).sha256(pixels)
    drawn = next(p.path for p in first.values() if p.path.parent == tmp_path / "a")
    before = drawn.stat().st_mtime_ns
    render(some.tasks, tmp_path / "a")
    assert drawn.stat().st_mtime_ns == before


def test_a_folder_of_pictures_becomes_a_suite(tmp_path: Path) -> None:
    entries = json.loads((PHOTOS / "annotations.json").read_text("utf-8"))[:1]
    (tmp_path / "images").symlink_to(PHOTOS / "images")
    entries[0]["tasks"].append(
        {
            "id": "nobody",
            "instruction": "Surround the giraffe.",
            "robots": None,
            "category": "general",
            "setup": "single",
            "expects": ["question"],
        }
    )
    (tmp_path / "annotations.json").write_text(json.dumps(entries))
    by_itself = load_suite(str(tmp_path))
    write_suite(tmp_path, "My Suite")
    made = load_suite(str(tmp_path))
    assert made.name == "my-suite"
    assert [task.content for task in made.tasks] == [task.content for task in by_itself.tasks]
    (tmp_path / "other.json").write_text(json.dumps(entries))
    assert load_suite(str(tmp_path / "other.json")).name == "other"
    assert len(made.tasks) == len(entries[0]["tasks"])
    assert made.tasks[-1].goals == ()
    with pytest.raises(InputError, match="is there already"):
        write_suite(tmp_path, "again")


def test_tasks_in_full_stand_in_the_file_itself(tmp_path: Path) -> None:
    entries = json.loads((PHOTOS / "annotations.json").read_text("utf-8"))[:1]
    (tmp_path / "images").symlink_to(PHOTOS / "images")
    (task,) = load_suite(write(tmp_path, [{"pictures": entries}])).tasks[:1]
    assert task.instruction == entries[0]["tasks"][0]["instruction"]
    assert task.picture == tmp_path / entries[0]["image"]


def test_what_is_wrong_with_a_suite_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="zerocap15"):
        load_suite("nonsense")
    with pytest.raises(InputError, match="train, dev, test"):
        load_suite("smoke", "holdout")
    with pytest.raises(InputError, match=r"no tasks in the split test\. It has: dev"):
        load_suite("smoke", "test")
    with pytest.raises(InputError, match="breaks the format"):
        load_suite(write(tmp_path, [{"scenes": "0-1", "photos": "all"}]))
    with pytest.raises(InputError, match="'nobody'"):
        load_suite(write(tmp_path, [{"photos": ["nobody"]}]))
    with pytest.raises(InputError, match="more than one task"):
        load_suite(write(tmp_path, [{"scenes": [3]}, {"scenes": [3]}]))
    with pytest.raises(InputError, match="in 2 splits"):
        splits = {"dev": ["table"], "test": ["table"]}
        load_suite(write(tmp_path, [{"scenes": [3], "family": "table"}], splits=splits))
    for seeds in ("9-3", "a-b", "0-20000"):
        with pytest.raises(InputError, match=f"seeds '{seeds}' are no range"):
            load_suite("scenes", seeds=seeds)
    with pytest.raises(InputError, match="not made of one range of seeds"):
        load_suite("photos", seeds="0-3")
    (tmp_path / "suite.yaml").write_text("a: [")
    with pytest.raises(InputError, match="is not YAML"):
        load_suite(str(tmp_path))


def test_looks_at_held_out_tasks_are_counted(tmp_path: Path) -> None:
    assert look(tmp_path, "s", "a" * 64, ["rules"]) == 1
    assert look(tmp_path, "s", "b" * 64, ["rules"]) == 1
    assert look(tmp_path, "s", "a" * 64, ["agent"]) == 2
    lines = (tmp_path / "heldout-ledger.jsonl").read_text("utf-8").splitlines()
    assert [json.loads(line)["arms"] for line in lines] == [["rules"], ["rules"], ["agent"]]
