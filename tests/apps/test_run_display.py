"""What a run shows of its contract on the terminal."""

from pathlib import Path

import pytest
from formup.apps.cli import app

COINS = Path(__file__).parents[2] / "evals/photos/images/us_coins.jpg"


@pytest.mark.parametrize(
    ("demanded", "shown"),
    [
        (
            "around the coin, all facing outwards, with a gap of 60 px on the left",
            "an opening of at least 60.0 px towards left, heading away",
        ),
        ("around the coin, at least 25 px apart", "at least 25.0 px apart"),
        ("in a V left of it", "forming V (left)"),
    ],
)
def test_the_contract_names_all_that_was_demanded(
    demanded: str,
    shown: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    words = f"Put 8 robots {demanded}"
    app(
        ["run", str(COINS), words, "--box", "175,30,314,160", "--plan-only", "--out", "out"],
        standalone_mode=False,
    )
    assert shown in " ".join(capsys.readouterr().out.split())
