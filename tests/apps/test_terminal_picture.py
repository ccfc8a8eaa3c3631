"""Pictures in a terminal: what is sent shows the picture, by each of the three ways."""

import base64
import io
import os
import pty
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from formup.apps.terminal_picture import Way, show_picture
from PIL import Image
from rich.console import Console
from rich.segment import Segment

Pixels = np.ndarray[Any, np.dtype[np.uint8]]
ANSWERS: dict[bytes, Way] = {
    b"\x1b_Gi=31;OK\x1b\\\x1b[?62;4c": "kitty",
    b"\x1b_Gi=31;EBADF:no\x1b\\\x1b[?62;4;22c": "sixel",
    b"\x1b[?1;2c": "blocks",
    b"\x1b[?64;14;24c": "blocks",
}
NAMES = {"12": (0.51, 0.5), "7": (1.2, 0.5), "100": (0.999, 0)}
"""The last two do not fit."""
ASKING = """
from formup.apps.terminal_picture import way_of_terminal
from rich.console import Console
print("way", way_of_terminal(Console(force_terminal=True)))
"""


@pytest.fixture
def page() -> Image.Image:
    pixels = np.zeros((90, 160, 3), np.uint8)
    pixels[:45, :80] = (200, 40, 40)
    pixels[45:, 80:] = (40, 80, 220)
    return Image.fromarray(pixels)


def sent(way: Way, page: Image.Image, capsys: pytest.CaptureFixture[str]) -> str:
    console = Console(width=80, height=30, force_terminal=True)
    show_picture(console, way, page, lambda room: page.resize(room), {})
    return capsys.readouterr().out


def sixels(text: str) -> Pixels:
    """A picture from its sixels, as the DEC manual has it."""
    head = re.match(r'\x1bPq"1;1;(\d+);(\d+)', text)
    assert head is not None
    width, height = map(int, head.groups())
    pixels = np.zeros((-(-height // 6) * 6, width, 3), np.uint8)
    palette: dict[int, tuple[int, ...]] = {}
    x = y = colour = 0
    body = text[head.end() : text.index("\x1b\\")]
    for found in re.finditer(r"#(\d+)(?:;2;(\d+);(\d+);(\d+))?|!(\d+)(.)|([?-~])|([$-])", body):
        number, *shares, count, repeated, single, move = found.groups()
        if number is not None:
            colour = int(number)
            if shares[0] is not None:
                palette[colour] = tuple(round(int(s) * 2.55) for s in shares)
        elif move is not None:
            x, y = 0, y + 6 * (move == "-")
        else:
            bits, after = ord(repeated or single) - 63, x + int(count or 1)
            for row in range(6):
                if bits >> row & 1:
                    pixels[y + row, x:after] = palette[colour]
            x = after
    return pixels[:height]


def test_sixels_are_the_picture(page: Image.Image, capsys: pytest.CaptureFixture[str]) -> None:
    shown = sixels(sent("sixel", page, capsys))
    assert shown.shape == (90, 160, 3)
    assert np.abs(shown.astype(int) - np.asarray(page)).max() <= 3


def test_kitty_is_sent_the_picture(page: Image.Image, capsys: pytest.CaptureFixture[str]) -> None:
    text = sent("kitty", page, capsys)
    chunks = re.findall(r"\x1b_G([^;]*);([^\x1b]*)\x1b\\", text)
    assert chunks[0][0].startswith("f=100,a=T")
    assert [keys[-1] for keys, _ in chunks] == ["1"] * (len(chunks) - 1) + ["0"]
    data = base64.standard_b64decode("".join(data for _, data in chunks))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(data))), np.asarray(page))


def test_half_blocks_have_two_pixels_a_cell(page: Image.Image) -> None:
    console = Console(width=40, height=20, color_system="truecolor", force_terminal=True)
    cells: list[Segment] = []
    console.print = lambda shown: cells.extend(console.render(shown))  # type: ignore[method-assign]
    show_picture(console, "blocks", page, lambda room: page.resize((40, 22), 0), NAMES)
    rows = [cells[i : i + 40] for i in range(0, len(cells), 41)]
    assert len(rows) == 11
    assert "".join(cell.text for cell in rows[5]) == "▀" * 20 + "12" + "▀" * 18
    first, last = rows[0][0].style, rows[-1][-1].style
    assert first is not None and last is not None
    assert first.color is not None and first.color.triplet == (200, 40, 40)
    assert last.bgcolor is not None and last.bgcolor.triplet == (40, 80, 220)


@pytest.mark.parametrize(("answer", "way"), ANSWERS.items())
def test_the_terminal_is_asked_what_it_can(answer: bytes, way: Way) -> None:
    ours, theirs = pty.openpty()
    environment = os.environ | {"TERM": "xterm-256color"}
    command = [sys.executable, "-c", ASKING]
    with subprocess.Popen(command, stdin=theirs, stdout=theirs, env=environment) as asked:
        os.close(theirs)
        said = b""
        while b"\x1b[c" not in said:
            said += os.read(ours, 1024)
        os.write(ours, answer)
        while b"way " not in said or not said.endswith(b"\n"):
            said += os.read(ours, 1024)
    os.close(ours)
    assert f"way {way}" in said.decode()
    assert asked.returncode == 0
