import pytest
from formup.agent.stopping import is_stop


@pytest.mark.parametrize(
    ("words", "driving", "stops"),
    [
        ("stop", False, True),
        ("STOP!!!", False, True),
        ("please stop the robots now", False, True),
        ("Stop, stop!", False, True),
        ("no stop that", False, True),
        ("stop 2 px before it", False, False),
        ("do not stop there", False, False),
        ("put them at the stop sign", False, False),
        ("hold on!", False, False),
        ("hold on!", True, True),
        ("don't move", True, True),
        ("wait", True, True),
        ("a bit further out", True, False),
    ],
)
def test_what_says_stop(words: str, driving: bool, stops: bool) -> None:
    assert is_stop(words, driving=driving) is stops
