"""Films of deployments as files: a GIF, an MP4, or a strip of moments as PNG, by file name."""

from collections.abc import Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

from ..errors import InputError
from ..fleet.follow import Rigid
from ..formation.plan import Plan
from ..geometry.outline import FloatArray
from ..perception.image import Picture
from ..store import write_whole
from ..world import World
from .canvas import (
    ALLOWED,
    CERTIFIED,
    FINDING,
    INK,
    MET,
    MUTED,
    PAPER,
    ROBOT,
    TARGET,
    WHITE,
    Colour,
)
from .film import draw_deployment

FILMS = (".gif", ".mp4", ".png")
"""File name extensions of films."""
TICK_MS, LAST_MS = 80, 2000
"""How long each frame is shown, and how long the last one."""
GIF_FRAMES, GIF_BYTES = 48, 3_000_000
GIF_SIDES = (640, 520, 420, 320)
"""Longest sides tried in turn until the file is small enough, px."""
MP4_SIDE, MP4_CODEC = 960, "mp4v"
"""Of the codecs in OpenCV's wheels, VP9 plays in browsers but takes twenty times as long."""
STRIP, STRIP_COLUMNS, STRIP_GAP = 6, 3, 6
"""Number of moments in a strip, how many stand side by side, and the gap between them, px."""
STYLE: tuple[Colour, ...] = (
    ROBOT,
    WHITE,
    INK,
    TARGET,
    PAPER,
    MUTED,
    CERTIFIED,
    FINDING,
    ALLOWED,
    MET,
)
"""Colours that a palette made from the photograph alone would lose."""


def save_film(
    path: Path,
    picture: Picture,
    world: World,
    plan: Plan,
    frames: Sequence[FloatArray],
    title: str,
    moved: Sequence[Rigid] = (),
) -> None:
    """Write a deployment as a film in the format of the file name's extension.

    For the arguments see `draw_deployment`.

    Raises:
        InputError: the extension is none of `FILMS`, or the file cannot be written.
    """
    kind, made = path.suffix.lower(), (picture, world, plan, frames, title)
    drawn = partial(draw_deployment, *made, moved=moved)
    if kind == ".mp4":
        save_mp4(drawn(side=MP4_SIDE), path)
    elif kind == ".gif":
        save_gif(drawn(moments=_even_indices(len(frames), GIF_FRAMES)), path)
    elif kind == ".png":
        save_strip(drawn(moments=_even_indices(len(frames), STRIP)), path)
    else:
        raise InputError(f"{path} is no film's name; let it end in {', '.join(FILMS)}.")


def save_gif(frames: Sequence[Image.Image], path: Path) -> None:
    """Write a looping GIF of 12 frames a second that rests on its last frame for 2 s.

    Of more than 48 frames, 48 evenly spaced ones are kept. All get the first frame's size, reduced
    to sides of at most 640 px, or less until the file is at most 3 MB (but never below 320 px). The
    file is written whole or not at all.

    Raises:
        InputError: there are no frames, or the file cannot be written.
    """
    _check_frames(frames)
    kept = [frames[i].convert("RGB") for i in _even_indices(len(frames), GIF_FRAMES)]
    data = b""
    for side in GIF_SIDES:
        data = _gif_bytes(kept, side)
        if len(data) <= GIF_BYTES:
            break
    write_whole(path, data)


def save_mp4(frames: Sequence[Image.Image], path: Path) -> None:
    """Write an MP4 of 12 frames a second that rests on its last frame for 2 s, whole or not at all.

    Raises:
        InputError: there are no frames, or the file cannot be written.
    """
    import cv2

    _check_frames(frames)
    width, height = (side + side % 2 for side in frames[0].size)  # the codec wants even sides
    with TemporaryDirectory() as folder:
        file = Path(folder) / "film.mp4"
        codec = cv2.VideoWriter.fourcc(*MP4_CODEC)
        writer = cv2.VideoWriter(str(file), codec, 1000 / TICK_MS, (width, height))
        for frame in [*frames, *[frames[-1]] * (LAST_MS // TICK_MS - 1)]:
            page = Image.new("RGB", (width, height), INK)
            page.paste(frame)
            writer.write(np.asarray(page)[:, :, ::-1].copy())
        writer.release()
        write_whole(path, file.read_bytes())


def save_strip(frames: Sequence[Image.Image], path: Path) -> None:
    """Write frames as one PNG, three side by side, the first at the upper left.

    Raises:
        InputError: there are no frames, or the file cannot be written.
    """
    _check_frames(frames)
    columns = min(STRIP_COLUMNS, len(frames))
    step = np.array(frames[0].size) + STRIP_GAP
    rows = -(-len(frames) // columns)
    page = Image.new("RGB", (columns * step[0] - STRIP_GAP, rows * step[1] - STRIP_GAP), PAPER)
    for i, frame in enumerate(frames):
        page.paste(frame, (i % columns * step[0], i // columns * step[1]))
    buffer = BytesIO()
    page.save(buffer, "PNG")
    write_whole(path, buffer.getvalue())


def _check_frames(frames: Sequence[Image.Image]) -> None:
    if not frames:
        raise InputError("There are no frames to save; draw at least one.")


def _even_indices(count: int, most: int) -> list[int]:
    """Return at most `most` evenly spaced indices of `count`, including the first and the last."""
    return [round(float(i)) for i in np.linspace(0, count - 1, min(count, most))]


def _gif_bytes(frames: Sequence[Image.Image], side: int) -> bytes:
    """Encode the frames as a GIF with no side longer than `side` px and one shared palette."""
    width, height = frames[0].size
    factor = min(side / max(width, height), 1.0)
    size = (max(round(width * factor), 1), max(round(height * factor), 1))
    sized = [f if f.size == size else f.resize(size, Image.Resampling.LANCZOS) for f in frames]
    palette = _shared_palette(sized)
    # Without dithering, what stands still stays identical, which is what keeps the file small.
    flat = [f.quantize(palette=palette, dither=Image.Dither.NONE) for f in sized]
    buffer = BytesIO()
    flat[0].save(
        buffer,
        "GIF",
        save_all=True,
        append_images=flat[1:],
        duration=[TICK_MS] * (len(flat) - 1) + [LAST_MS],
        loop=0,
        optimize=True,
        disposal=1,
    )
    return buffer.getvalue()


def _shared_palette(frames: Sequence[Image.Image]) -> Image.Image:
    """Return a palette for all frames: the style's colours, the rest from three of the frames.

    These are the first, the middle and the last one.
    """
    width, height = frames[0].size
    sample = Image.new("RGB", (width, 3 * height))
    for row, frame in enumerate((frames[0], frames[len(frames) // 2], frames[-1])):
        sample.paste(frame, (0, row * height))
    colours = sample.quantize(255 - len(STYLE)).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([v for colour in STYLE for v in colour] + colours)
    return palette
