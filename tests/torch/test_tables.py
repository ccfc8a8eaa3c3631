"""Table 2 through the networks themselves, with weights that say nothing: no figure is shown."""

import csv
from pathlib import Path

from formup.apps.cli import app
from formup.evals.experiments.journal import read_rows

ROWS = ("CLIPSeg alone", "LangSAM alone", "without weights, alone")


def test_segmentation_alone_is_run_and_its_figures_are_left_out(
    checkpoints: Path, tmp_path: Path
) -> None:
    pair = f"langsam:{checkpoints / 'groundingdino'},{checkpoints / 'sam'}"
    run = ["eval", "table", "2", "--method", "segment-only", "--task", "us_coins_t1"]
    run += ["--segmenter", f"clipseg:{checkpoints / 'clipseg'}", "--segmenter", pair]
    out = tmp_path / "run"
    assert not app([*run, "--out", str(out)], standalone_mode=False)
    assert len(read_rows(out)) == len(ROWS)
    with (out / "table.csv").open(encoding="utf-8", newline="") as file:
        lines = [line for line in csv.DictReader(file) if line["column"] == "total"]
    assert tuple(line["row"] for line in lines) == ROWS
    assert [line["scored"] for line in lines] == ["0", "0", "1"]
    for line in lines[:2]:
        assert "figures of weights too few to be trained are not shown" in line["remarks"]
        assert line["paper_sr"] in ("0.51", "0.43")
