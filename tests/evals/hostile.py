"""Folders of runs whose every text tries to be more than text, for tests of the report."""

import json
from pathlib import Path

import numpy as np
from formup.agent.agent import Agent
from formup.agent.messages import Call, Reply
from formup.agent.wrappers.doubles import ScriptedModel
from formup.evals.experiments.journal import Manifest
from formup.evals.experiments.seals import sealed_all
from formup.evals.experiments.suite_work import attempt_name
from formup.evals.experiments.trials import Arm, Status, Trial, TrialRow
from formup.evals.statistics.cells import Chance
from formup.evals.tasks.rendered_pictures import RenderedPicture, pixel_hash
from formup.evals.tasks.stored_suite import StoredSuite
from formup.evals.tasks.task import Goal, Task, Thing
from formup.tools.perception.image import load_picture
from PIL import Image

EVIL = (
    "</title></style></script></textarea></svg><script>alert(1)</script>"
    "<img src=x onerror=alert(2)>\"'><svg onload=alert(3)> javascript:alert(4) &lt;b&gt; "
    "<style>body{display:none}</style> <a href='https://example.com/'>x</a> \u202e\x00\ud800"
)
"""Whatever of it a browser takes for HTML shows: it runs, loads, or hides the page."""
SUITE = "5" * 64
TASKS = 6
KINDS, SETUPS = ("general", "caging"), ("single", "multi", "hidden")
SECRET = "the magpie is held out"


def write_run(folder: Path, method: str, *, passing: int, split: str = "dev") -> Path:
    """A run of six tasks of two trials each; the first so many tasks pass."""
    (folder / "attempts").mkdir(parents=True)
    pixels = np.full((120, 160, 3), 90, np.uint8)
    pixels[40:80, 60:100] = (200, 40, 40)
    Image.fromarray(pixels).save(folder / "square.png")
    rows = [_row(i, n, method, i < passing) for i in range(TASKS) for n in range(2)]
    pixels_hash = pixel_hash(load_picture(folder / "square.png"))
    picture = RenderedPicture(Path("square.png"), pixels_hash)
    suite = StoredSuite(
        name="hostile",
        description=EVIL.replace("\ud800", ""),
        split=split,
        sha256=SUITE,
        chance=dict.fromkeys(
            ("total", *KINDS, *SETUPS, *(f"{kind} {setup}" for kind in KINDS for setup in SETUPS)),
            Chance(0.1, 0.2),
        ),
        tasks=tuple(_task(i, folder) for i in range(TASKS)),
        pictures={_name(i): picture for i in range(TASKS)},
    )
    (folder / "suite.json").write_text(suite.model_dump_json(), "utf-8")
    (folder / "manifest.json").write_text(Manifest.of(rows).model_dump_json(), "utf-8")
    (folder / "trials.jsonl").write_bytes(b"".join(row.line for row in sealed_all(rows)))
    for row in rows:
        _keep(folder, row)
    return folder


def _name(number: int) -> str:
    return f"task {number} {EVIL}".replace("\ud800", "")


def _row(number: int, trial: int, method: str, passes: bool) -> TrialRow:
    made = Trial(
        suite=SUITE,
        task=_name(number),
        trial=trial,
        arm=Arm(
            method=f"{method}<script>alert(5)</script>",
            prompt="</td><script>alert(6)</script>",
            model="a:b'\"><script>alert(7)</script>",
        ),
        category="caging" if number % 2 else "general",
        setup=SETUPS[number // 2],
    )
    status: Status = "pass" if passes else "fail"
    return TrialRow.of(
        made,
        status,
        gcr=1.0 if passes else 0.5,
        strict=passes,
        feedback="" if passes else f"{SECRET} {EVIL}".replace("\ud800", ""),
        input_tokens=1234,
        output_tokens=56,
        cost_usd=0.0123,
        seconds=2.5,
    )


def _task(number: int, folder: Path) -> Task:
    ring = [[60.0, 40.0], [100.0, 40.0], [100.0, 80.0], [60.0, 80.0]]
    thing = Thing("square", EVIL.replace("\ud800", ""), ring, [])
    corners = {"where": "corners", "points": ring, "tolerance_px": 6}
    band = {"where": "boundary", "band_px": [3, 20], "max_gap_px": 70}
    return Task(
        id=_name(number),
        instruction=f"{SECRET} {EVIL}".replace("\ud800", ""),
        robots=4,
        category="caging" if number % 2 else "general",
        setup=SETUPS[number // 2],
        family="",
        split="dev",
        style="plain",
        referring="",
        goals=(Goal(4, (160, 120), thing, band if number % 2 else corners),),
        expects=("deployed",),
        picture=folder / "square.png",
    )


def _keep(folder: Path, row: TrialRow) -> None:
    """Three robots right and one wrong, unless it passes; of first trials a trace as well."""
    points = [[58.0, 38.0], [102.0, 38.0], [102.0, 82.0], [58.0, 82.0]]
    if not row.sr:
        points[3] = [900.0, -50.0]
    kept = {
        "message": EVIL,
        "planned": points,
        "observed": points,
        "found": [[[61.0, 41.0], [99.0, 41.0], [99.0, 79.0]]],
        "graded": {"right": [True, True, True, bool(row.sr)]},
    }
    path = folder / "attempts" / attempt_name(row)
    path.with_suffix(".json").write_text(json.dumps(kept), "utf-8")
    if row.trial == 0:
        calls = (Call(id="1", name=EVIL[:60], arguments={"x": EVIL.replace("\ud800", "")}),)
        replies = [Reply(calls=calls), Reply(text=EVIL.replace("\ud800", "") + "y" * 5000)]
        agent = Agent(ScriptedModel(replies))
        picture = load_picture(folder / "square.png")
        agent.run(picture, "Go <script>alert(8)</script>", trace=path.with_suffix(".jsonl"))
