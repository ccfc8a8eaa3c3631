"""Samples of outlines: what they are compared by, and the tables made of them."""

import json

import numpy as np
import pytest
from formup.apps import eval_perception
from formup.apps.cli import app
from formup.evals.perception.fit import CUES, fit_weights, held_out_likelihoods
from formup.evals.perception.samples import TRIALS, Sample, measured
from formup.evals.perception.tables import markdown, reliability, row
from formup.tools.errors import InputError
from formup.tools.perception.segmenters.confidence import fitted_weights
from formup.tools.perception.segmenters.grabcut_segmenter import GrabCutSegmenter
from formup.tools.perception.segmenters.protocol import Segmenter
from shapely.geometry import box

SQUARE = box(0, 0, 100, 100)


def sample(overlap: float, confidence: float, picture: str = "p", **cues: float) -> Sample:
    return Sample("s", picture, "t", overlap, 0.05, confidence, 0.5, cues, 0.2, 0.1)


def test_a_row_counts_what_is_right_and_what_is_placed() -> None:
    found = [sample(0.9, 0.9), sample(0.7, 0.8), sample(0.95, 0.3), sample(0.2, 0.1)]
    made = row("grabcut", "box", "photos", found)
    assert (made.masks, made.right, made.placed, made.wrong_if_placed) == (4, 0.5, 0.5, 0.5)
    assert made.time_ratio == pytest.approx(2.0)
    table = markdown([made])
    assert "| grabcut | box | photos | 4 |" in table
    assert sum(b.masks for b in made.reliability) == 4


def test_reliability_compares_confidence_with_the_share_that_is_right() -> None:
    bins = list(reliability(np.array([0.1, 0.95, 0.97, 1.0]), np.array([0.0, 1.0, 1.0, 0.0])))
    assert [(b.low, b.masks) for b in bins] == [(0.0, 1), (0.9, 3)]
    assert bins[1].right == pytest.approx(0.667)


def test_weights_are_found_again_and_never_below_zero() -> None:
    random = np.random.default_rng(1)
    cues = random.uniform(0, 1, (4000, 2))
    likely = 1 / (1 + np.exp(-(-3 + 6 * cues[:, 0] - 2 * cues[:, 1])))
    right = (random.uniform(0, 1, 4000) < likely).astype(float)
    constant, first, second = fit_weights(cues, right)
    assert first == pytest.approx(6, rel=0.2)
    assert second == 0
    assert constant < -3


def test_a_picture_left_out_says_nothing_of_itself() -> None:
    found = [sample(0.9, 0, "a")] * 10 + [sample(0.1, 0, "b")] * 10
    cues, right = np.zeros((20, 1)), np.repeat([1.0, 0.0], 10)
    likely = held_out_likelihoods(found, cues, right)
    assert (likely[:10] < 0.5).all() and (likely[10:] > 0.5).all()


def test_the_shipped_weights_are_of_the_cues_that_are_fitted() -> None:
    for way, names in CUES.items():
        weights = fitted_weights()[way]  # type: ignore[index]
        assert set(weights) == {"constant", *names}
        assert all(w >= 0 for name, w in weights.items() if name != "constant")


def test_every_thing_of_a_suite_is_measured_as_often_as_it_says() -> None:
    found = list(measured("smoke", "outline", GrabCutSegmenter()))
    counts = {(s.picture, s.thing) for s in found}
    assert len(found) == TRIALS * len(counts) > 0
    assert np.mean([s.overlap for s in found]) > 0.85
    with pytest.raises(InputError, match="one thing on a picture"):
        list(measured("scenes", "box", GrabCutSegmenter()))


def test_the_command_prints_json(capsys: pytest.CaptureFixture[str]) -> None:
    app(["eval", "perception", "smoke", "--mode", "outline", "--json"], standalone_mode=False)
    (made,) = json.loads(capsys.readouterr().out)["rows"]
    assert made["mode"] == "outline" and made["overlap"] > 0.85


def test_an_unknown_mode_is_named() -> None:
    with pytest.raises(
        InputError, match=r"Unknown mode 'words'\. There are: outline, box, point\."
    ):
        app(["eval", "perception", "smoke", "--mode", "words"], standalone_mode=False)


class BoxesOnly(GrabCutSegmenter):
    takes = frozenset({"box"})


def test_a_mode_that_a_segmenter_does_not_take_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def named(name: str) -> Segmenter:
        return BoxesOnly()

    monkeypatch.setattr(eval_perception, "segmenter_named", named)
    with pytest.raises(InputError, match="takes only box"):
        app(["eval", "perception", "photos", "--mode", "point"], standalone_mode=False)
