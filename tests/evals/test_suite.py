"""The shipped photographs, their format, their graders and the runs over them."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.evals.experiments.pointed import evaluate, mode_named, one_target, summary
from formup.evals.grading.photo_rules import grade
from formup.evals.tasks.photographs import Task, load_tasks, photos_folder
from formup.tools.errors import InputError
from formup.tools.geometry.outline import FloatArray
from formup.tools.perception.image import load_picture

TASKS = load_tasks()
IDS = [task.id for task in TASKS]
ONE_TARGET = one_target(TASKS)


def test_what_ships() -> None:
    assert len(TASKS) == 30
    assert len({task.image for task in TASKS}) == 14
    assert len(ONE_TARGET) == 29
    for name in {task.image.name for task in TASKS}:
        assert name in (photos_folder() / "LICENSES.md").read_text("utf-8")
        assert not name.startswith("oam_")


def test_pictures_are_the_annotated_ones() -> None:
    entries: list[dict[str, Any]] = json.loads((photos_folder() / "annotations.json").read_text())
    for entry in entries:
        path = photos_folder() / entry["image"]
        assert hashlib.sha256(path.read_bytes()).hexdigest() == entry["sha256"]
        assert load_picture(path).size == (entry["width"], entry["height"])


def test_a_users_own_folder_is_validated(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"annotations\.json"):
        load_tasks(tmp_path)
    (tmp_path / "annotations.json").write_text("nonsense")
    with pytest.raises(InputError, match="not JSON"):
        load_tasks(tmp_path)
    entry: dict[str, Any] = {
        "image": "a.png",
        "width": 9,
        "height": 9,
        "tasks": [],
        "objects": [{"id": "x"}],
    }
    (tmp_path / "annotations.json").write_text(json.dumps([entry]))
    with pytest.raises(InputError, match="'name' is a required"):
        load_tasks(tmp_path)
    (tmp_path / "annotations.json").write_text(json.dumps([entry | {"objects": []}]))
    with pytest.raises(InputError, match=r"a\.png"):
        load_tasks(tmp_path)


def test_true_outlines_are_placed_and_graded_strictly_right() -> None:
    rows = evaluate(TASKS, "truth", 1)
    assert [row.task for row in rows if not (row.strict and row.certified)] == []


def test_pointed_runs_are_reproducible_and_mostly_right() -> None:
    some = [t for t in ONE_TARGET if t.image.stem in ("us_coins", "ucm_golfcourse15")]
    rows = evaluate(some, "outline", 1)
    assert rows == evaluate(some, "outline", 1)
    means = summary(rows)["total"]
    assert means["success"] == 1
    assert means["iou"] is not None
    assert means["iou"] > 0.85


def test_words_alone_place_the_right_thing_or_ask() -> None:
    some = [t for t in TASKS if t.image.stem in ("us_coins", "fork_black", "cars_two")]
    rows = {row.task: row for row in evaluate(some, "words", 1)}
    assert rows["us_coins_t1"].right is True
    assert rows["us_coins_t1"].success
    assert rows["fork_black_t1"].status == "question"
    assert rows["fork_black_t1"].right is None
    means = summary(list(rows.values()))
    placed = [row for row in rows.values() if row.right is not None]
    assert means["total"]["placed"] == len(placed) / len(rows)
    assert means["total"]["right_of_placed"] == 1
    assert "caging" in means
    assert "multi" in means


def test_the_wrong_thing_is_told_from_the_right_one() -> None:
    task = next(t for t in TASKS if t.other is not None)
    (row,) = evaluate([task], "truth", 1)
    assert row.right is True  # both things
    swapped = replace(task, target=task.other, other=task.target)
    assert evaluate([swapped], "truth", 1)[0].right is True  # in either order
    coins = [t for t in TASKS if t.image.stem == "us_coins"]
    mixed = replace(coins[0], target=coins[1].target)
    assert evaluate([mixed], "words", 1)[0].right is False


def test_modes_have_names() -> None:
    with pytest.raises(InputError, match="'psychic'"):
        mode_named("psychic")


def dumb(name: str, task: Task) -> FloatArray:
    """Policies that understand nothing."""
    n, (width, height) = task.robots, task.size
    random = np.random.default_rng(0)
    outline = task.target.outline
    x0, y0, x1, y1 = outline.bounds
    turns = 2 * np.pi * np.arange(n) / n
    circle = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return {
        "pile": np.tile(outline.centre, (n, 1)),
        "picture": random.uniform((0, 0), (width - 1, height - 1), (n, 2)),
        "box": random.uniform((x0, y0), (x1, y1), (n, 2)),
        "diagonal": np.linspace((x0, y0), (x1, y1), n),
        "tiny circle": np.asarray(outline.centre) + circle * 3,
    }[name]


@pytest.mark.parametrize("name", ["pile", "picture", "box", "diagonal", "tiny circle"])
def test_policies_that_understand_nothing_fail(name: str) -> None:
    passed = [task.id for task in TASKS if grade(task, dumb(name, task)).success]
    assert passed == []


def test_the_grader_counts_and_bounds() -> None:
    task = TASKS[0]
    assert grade(task, None).failures == ["nothing was placed"]
    assert "positions for" in grade(task, [(1, 1)]).failures[0]
    outside = np.asarray(task.success["points"]) - (1000, 0)
    assert "outside the picture" in grade(task, outside).failures[0]


@pytest.mark.parametrize("task", TASKS, ids=IDS)
def test_order_of_robots_does_not_matter(task: Task) -> None:
    random = np.random.default_rng(1)
    points = random.uniform((0, 0), (task.size[0] - 1, task.size[1] - 1), (task.robots, 2))
    assert grade(task, points).failures == grade(task, points[::-1]).failures
