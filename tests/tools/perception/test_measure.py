"""What is pointed at is measured by any segmenter, of ours or of a package that is installed."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from formup.tools.errors import InputError, ToolError
from formup.tools.geometry.outline import outline_of
from formup.tools.perception.detectors.registry import DETECTORS, detector_named
from formup.tools.perception.image import Picture, picture_from_array
from formup.tools.perception.measure import measure_outline, unlike_drawn
from formup.tools.perception.segmenters.registry import SEGMENTERS, segmenter_named
from formup.tools.perception.target_prompt import TargetPrompt
from PIL import Image
from shapely.geometry import Point, box

BOX = (60.0, 40.0, 139.0, 99.0)


@pytest.fixture
def lamp() -> Picture:
    """A bright rectangle, BOX, on a dark ground."""
    pixels = np.full((150, 220, 3), 30, dtype=np.uint8)
    pixels[40:100, 60:140] = 230
    return picture_from_array(pixels)


def test_what_is_built_in_goes_in_as_other_packages_do() -> None:
    assert SEGMENTERS.names() == ("grabcut", "clipseg", "langsam", "sam", "sam2.1")
    assert DETECTORS.names() == ("standout", "groundingdino", "mm-groundingdino", "vlm")
    assert segmenter_named("grabcut") is segmenter_named("grabcut")
    assert segmenter_named("grabcut").name == "grabcut"
    assert detector_named("standout").name == "standout"
    for registry in (SEGMENTERS, DETECTORS):
        for name in registry.names():
            assert getattr(registry.load(name), "name", name) == name


def test_only_what_is_made_from_a_checkpoint_takes_one() -> None:
    with pytest.raises(InputError, match=r"'grabcut' takes no checkpoint; got 'file'\."):
        segmenter_named("grabcut:file")


@pytest.mark.skipif(find_spec("torch") is not None, reason="the extra is there")
@pytest.mark.parametrize("named", [segmenter_named, detector_named])
def test_a_network_without_the_extra_is_one_sentence_that_names_it(
    named: Callable[[str], object],
) -> None:
    name = "clipseg" if named is segmenter_named else "groundingdino"
    with pytest.raises(InputError, match=r"need the extra: pip install 'formup\[torch\]'\."):
        named(name)


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"Unknown segmenter 'knife'\. There are: grabcut, cl"):
        segmenter_named("knife")
    with pytest.raises(InputError, match=r"Unknown detector 'eye'\. There are: standout, gr"):
        detector_named("eye")


@pytest.mark.usefixtures("example_package")
def test_an_installed_segmenter_is_used_by_its_name(lamp: Picture) -> None:
    assert "example-ellipse" in SEGMENTERS.names()
    ellipse = segmenter_named("example-ellipse")
    found = measure_outline(lamp, TargetPrompt(box=BOX), ellipse)
    assert found.confidence == 0.9
    assert found.parts == {"example": 0.9}
    assert found.outline.area == pytest.approx(np.pi / 4 * 79 * 59, rel=0.03)


@pytest.mark.usefixtures("example_package")
def test_what_a_segmenter_does_not_take_is_refused(lamp: Picture) -> None:
    ellipse = segmenter_named("example-ellipse")
    drawn = TargetPrompt(outline=((60, 40), (139, 40), (139, 99)), points=((100, 50),))
    with pytest.raises(ToolError) as refused:
        measure_outline(lamp, drawn, ellipse)
    assert str(refused.value) == (
        "The segmenter 'example-ellipse' cannot be pointed with outline or points. "
        "It takes box: use that, or another segmenter."
    )


@pytest.mark.usefixtures("example_package")
def test_an_installed_detector_finds_candidates_that_any_segmenter_measures(lamp: Picture) -> None:
    bright = detector_named("example-bright")
    (candidate,) = bright.detect(lamp)
    assert candidate.label == "white rectangle"
    assert not candidate.attributes.touches_border
    prompt = TargetPrompt(candidate=candidate.id)
    by_outline = measure_outline(lamp, prompt, segmenter_named("grabcut"), candidate)
    by_box = measure_outline(lamp, prompt, segmenter_named("example-ellipse"), candidate)
    truth = box(59.5, 39.5, 139.5, 99.5)
    for found in (by_outline, by_box):
        shared = found.outline.polygon.intersection(truth).area
        assert shared > 0.95 * found.outline.polygon.union(truth).area
    # An ellipse is not what the detector found: its outline stays, and is trusted less.
    assert by_box.outline == candidate.outline
    assert by_box.confidence == pytest.approx((np.pi / 4 + 0.8) / 2, abs=0.02)


def test_an_entry_point_that_leads_nowhere_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    facts = tmp_path / "absent-1.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: absent\nVersion: 1\n")
    entry = "[formup.segmenters]\nexample-absent = json:NotThere\n"
    (facts / "entry_points.txt").write_text(entry)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"'example-absent' .* cannot be imported"):
        segmenter_named("example-absent")


def test_an_installed_segmenter_runs_from_the_command_line(
    installed: Path, lamp: Picture, tmp_path: Path
) -> None:
    Image.fromarray(lamp.pixels).save(tmp_path / "lamp.png")
    command = [sys.executable, "-m", "formup", "run", "lamp.png", "surround it", "-n", "6"]
    command += ["--box", ",".join(map(str, BOX)), "--segmenter", "example-ellipse"]
    found = [str(installed), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [*command, "--plan-only", "--json"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, found))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (target,) = json.loads(done.stdout)["targets"]
    assert target["confidence"] == 0.9


def test_vertices_that_the_measured_outline_leaves_out_are_named(lamp: Picture) -> None:
    drawn = ((60, 40), (139, 40), (200, 120), (139, 99), (60, 99))
    prompt = TargetPrompt(outline=drawn)
    found = measure_outline(lamp, prompt, segmenter_named("grabcut"))
    ((x, y, px),), added = unlike_drawn(found.outline, prompt, *lamp.size)
    assert (x, y, added) == (200.0, 120.0, ())
    assert px == pytest.approx(found.outline.filled.distance(Point(200, 120)))
    assert px > 5
    assert unlike_drawn(found.outline, TargetPrompt(box=BOX), *lamp.size) == ((), ())


@pytest.mark.parametrize(
    ("drawn", "added"),
    [
        ((60, 40, 100, 99), [(139, 39)]),  # half of it
        ((60, 40, 132, 99), [(139, 7)]),  # a fringe
        ((60, 40, 136, 99), []),  # as exactly as anybody draws
        ((-50, 40, 139, 99), []),  # what lies outside of the picture cannot be measured
    ],
)
def test_what_was_measured_beyond_the_outline_drawn_is_named(
    lamp: Picture, drawn: tuple[float, ...], added: list[tuple[float, float]]
) -> None:
    found = unlike_drawn(outline_of(box(*BOX)), TargetPrompt(outline=corners(drawn)), *lamp.size)
    assert [(x, round(px)) for x, _, px in found[1]] == added


def test_parts_that_points_were_given_for_are_meant_so(lamp: Picture) -> None:
    wide, narrow = corners((60, 40, 200, 99)), corners((60, 40, 100, 99))
    measured = outline_of(box(*BOX))
    off = TargetPrompt(outline=wide, negative=((180, 70),))
    on = TargetPrompt(outline=narrow, points=((120, 70),))
    assert unlike_drawn(measured, off, *lamp.size) == ((), ())
    assert unlike_drawn(measured, on, *lamp.size) == ((), ())


def corners(x0y0x1y1: tuple[float, ...]) -> tuple[tuple[float, float], ...]:
    x0, y0, x1, y1 = x0y0x1y1
    return (x0, y0), (x1, y0), (x1, y1), (x0, y1)
