"""Starting positions as other programs write them."""

from pathlib import Path

import pytest
from formup.apps.starts import starts
from formup.tools.errors import InputError

SPOTS = ((20.5, 60.0), (540.0, 7.25))


@pytest.mark.parametrize(
    "text",
    [
        "20.5,60\n540,7.25\n",
        "20.5,60\r\n540,7.25\r\n",
        "20.5;60\n540;7.25",
        "20,5;60\n540;7,25\n",
        "20,5\t60\n540\t7,25\n",
        "20.5 60\n540   7.25\n",
        "x,y\n20.5,60\n540,7.25\n",
        "X [px]; Y [px]\n20,5;60\n540;7,25\n",
        "row,col\n60,20.5\n7.25,540\n",
        '"y","x"\n"60","20.5"\n"7.25","540"\n',
        "# the dock\n\n20.5,60,\n# and the gate\n540,7.25,\n",
        "[[20.5, 60], [540, 7.25]]",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_tables_and_json(tmp_path: Path, text: str, encoding: str) -> None:
    (tmp_path / "starts.csv").write_bytes(text.encode(encoding))
    assert starts(tmp_path / "starts.csv") == SPOTS


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("20,60\n20,5,60,5\n", "line 2: '20,5,60,5'"),
        ("robot,x,y\n1,20,60\n", "line 1: 'robot,x,y'"),
        ("east,north\n20,60\n", "line 1: 'east,north'"),
        ("x_m,y_m\n2,6\n", "line 1: 'x_m,y_m'"),
        ("20,60\n\n# a comment\n20px,60px\n", "line 4: '20px,60px'"),
        ("1.234,5;60\n", "line 1: '1.234,5;60'"),
        ("20,60\nx,y\n", "line 2: 'x,y'"),
        ("20\n", "line 1: '20'"),
        ("x,y\n", "holds no usable positions"),
        ("20,inf\n", "holds no usable positions"),
        ('{"starts": [[20, 60]]}', "line 1"),
        ('[{"x": 20, "y": 60}]', "holds no usable positions"),
    ],
)
def test_what_cannot_be_read_is_named_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "starts.csv").write_text(text)
    with pytest.raises(InputError) as caught:
        starts(tmp_path / "starts.csv")
    assert said in str(caught.value)
    assert "one x,y per line" in str(caught.value)
