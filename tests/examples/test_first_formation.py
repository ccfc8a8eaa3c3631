"""The notebook is run cell by cell in a kernel, as in Jupyter."""

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "examples/first_formation.ipynb"


def test_the_notebook_gets_from_a_photograph_to_a_formation(tmp_path: Path) -> None:
    reason = "needs nbclient and ipykernel, which are among the extras for development"
    client: Any = pytest.importorskip("nbclient", reason=reason)
    pytest.importorskip("ipykernel", reason=reason)
    notebook: Any = import_module("nbformat").read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    assert sum(len(cell.source.splitlines()) for cell in notebook.cells) < 100
    (tmp_path / "evals").symlink_to(ROOT / "evals")
    (tmp_path / "examples").mkdir()
    where = {"metadata": {"path": str(tmp_path / "examples")}}
    client.NotebookClient(notebook, timeout=300, resources=where).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    pictures = [output for output in outputs if "image/png" in output.get("data", {})]
    assert len(pictures) == 3
    said = [output["data"]["text/plain"] for output in outputs if "data" in output]
    assert sum("All arrived" in text for text in said) == 1
    with Image.open(tmp_path / "examples/first_formation.jpg") as picture:
        assert picture.size == (520, 520)
