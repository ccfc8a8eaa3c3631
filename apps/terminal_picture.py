"""Pictures in a terminal: kitty's protocol or sixels if it says it can, otherwise half blocks."""

import base64
import os
import re
import select
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from typing import Literal

import numpy as np
from PIL import Image
from rich.color import Color
from rich.console import Console, ConsoleOptions
from rich.segment import Segment
from rich.style import Style

from .terminal import draw

Way = Literal["kitty", "sixel", "blocks", "none"]
Names = Mapping[str, tuple[float, float]]
"""Short labels and their places, as fractions of the picture's width and height."""
PATIENCE = 0.5
"""Seconds to wait for a terminal to say what it supports; most take a thousandth of that."""
WIDEST, CELL = 100, (8, 16)
"""Most columns of a picture; assumed size of a cell, pixels."""
WRITTEN = Style(color=Color.from_rgb(255, 255, 255), bgcolor=Color.from_rgb(0, 92, 184), bold=True)
CHUNK = 4096
KITTY, SIXEL = re.compile(rb"\x1b_Gi=31;OK"), re.compile(rb"\x1b\[\?(?:\d+;)*4(?:;\d+)*c")
ENDS = re.compile(rb"\x1b\[\?[\d;]*c")
ASK = "\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[c"
"""Asks whether kitty's protocol works, then for the device attributes, which all terminals send."""


def way_of_terminal(console: Console) -> Way:
    """Ask the terminal how it can show pictures, and return the best way."""
    if not console.is_terminal or console.is_dumb_terminal or console.color_system is None:
        return "none"
    said = _identity()
    return "kitty" if KITTY.search(said) else "sixel" if SIXEL.search(said) else "blocks"


def show_picture(
    console: Console,
    way: Way,
    page: Image.Image,
    small: Callable[[tuple[int, int]], Image.Image],
    names: Names,
) -> None:
    """Show a picture in the terminal.

    Args:
        page: the picture as it is in the file, shown by kitty's protocol and sixels.
        small: draws it anew for half blocks, given the largest width and height in pixels.
        names: labels to write over the half blocks.
    """
    columns, rows = min(console.width, WIDEST), max(console.height * 2 // 3, 8)
    if way == "blocks":
        console.print(_HalfBlocks(small((columns, 2 * rows)), names))
    elif way != "none":
        fitting = page.copy()
        fitting.thumbnail((columns * CELL[0], rows * CELL[1]), Image.Resampling.LANCZOS)
        draw((_kitty(fitting) if way == "kitty" else _sixels(fitting)) + "\n")


class _HalfBlocks:
    """A picture of two pixels per cell, the upper one as a coloured ▀, with labels over it."""

    def __init__(self, image: Image.Image, names: Names) -> None:
        self._pixels = np.asarray(image.convert("RGB"))
        rows, columns = len(self._pixels) // 2, image.width
        self._letters: dict[tuple[int, int], str] = {}
        for name, (x, y) in names.items():
            row, column = int(y * rows), int(x * columns) - (len(name) - 1) // 2
            fits = 0 <= row < rows and 0 <= column <= columns - len(name)
            cells = [(row, column + i) for i in range(len(name))]
            around = [(row, column + i) for i in range(-1, len(name) + 1)]
            if fits and not any(cell in self._letters for cell in around):
                self._letters |= dict(zip(cells, name, strict=True))

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        pairs = zip(self._pixels[::2], self._pixels[1::2], strict=False)
        for row, (top, bottom) in enumerate(pairs):
            for column, colours in enumerate(zip(top.tolist(), bottom.tolist(), strict=True)):
                upper, lower = (Color.from_rgb(*colour) for colour in colours)
                letter = self._letters.get((row, column))
                if letter is None:
                    yield Segment("▀", Style(color=upper, bgcolor=lower))
                else:
                    yield Segment(letter, WRITTEN)
            yield Segment.line()


def _kitty(image: Image.Image) -> str:
    file = BytesIO()
    image.save(file, "PNG")
    data = base64.standard_b64encode(file.getvalue()).decode()
    chunks = [data[i : i + CHUNK] for i in range(0, len(data), CHUNK)]
    keys = ["f=100,a=T,", *[""] * (len(chunks) - 1)]
    more = [1] * (len(chunks) - 1) + [0]
    parts = zip(keys, more, chunks, strict=True)
    return "".join(f"\x1b_G{key}m={m};{chunk}\x1b\\" for key, m, chunk in parts)


def _sixels(image: Image.Image) -> str:
    """Encode an image as sixels: bands of six rows, with a pass for each colour in a band."""
    flat = image.convert("RGB").quantize(255)
    pixels, palette = np.asarray(flat), np.array(flat.getpalette()).reshape(-1, 3)
    shares = (palette * 100 / 255).round().astype(int).tolist()
    parts = [f'\x1bPq"1;1;{image.width};{image.height}']
    parts += [f"#{i};2;{r};{g};{b}" for i, (r, g, b) in enumerate(shares)]
    for top in range(0, image.height, 6):
        band = pixels[top : top + 6]
        bits = 1 << np.arange(len(band))[:, None]
        passes = (f"#{c}{_runs(((band == c) * bits).sum(axis=0))}" for c in np.unique(band))
        parts.append("$".join(passes) + "-")
    return "".join(parts) + "\x1b\\"


def _runs(columns: np.ndarray) -> str:
    """Encode columns of six pixels as letters, with a count for runs of more than three."""
    starts = np.concatenate([[0], np.flatnonzero(np.diff(columns)) + 1, [len(columns)]])
    runs = zip(columns[starts[:-1]].tolist(), np.diff(starts).tolist(), strict=True)
    return "".join(f"!{n}{chr(63 + c)}" if n > 3 else chr(63 + c) * n for c, n in runs)


def _identity() -> bytes:
    """Return the terminal's answer to `ASK`; empty if it cannot be asked."""
    try:
        import termios
        import tty

        keyboard = sys.stdin.fileno()
        before = termios.tcgetattr(keyboard)
    except (ImportError, OSError, ValueError):
        return b""
    said, until = b"", time.monotonic() + PATIENCE
    try:
        tty.setcbreak(keyboard)
        draw(ASK)
        while not ENDS.search(said) and (left := until - time.monotonic()) > 0:
            if select.select([keyboard], [], [], left)[0]:
                said += os.read(keyboard, 1024)
    finally:
        termios.tcsetattr(keyboard, termios.TCSANOW, before)
    return said
