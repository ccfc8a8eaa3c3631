"""Loads picture files safely, whatever they hold.

The result is plain RGB pixels as a person would see them, or one ImageError that says what is
wrong and what to do. File size and header are checked before a decoder can use much memory.
"""

import hashlib
import logging
import os
import re
import stat
import warnings
from collections.abc import Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, TiffImagePlugin, UnidentifiedImageError, features

from ..errors import ImageError
from .deep_values import as_8_bits
from .geotiff import Georeference, georeference_of

MAX_FILE_BYTES = 64 * 2**20
MAX_PIXELS = 50_000_000
MAX_SIDE = 20_000
MIN_SIDE = 16
STRIP = 64
"""Number of rows copied at a time: few enough to stay in the processor's cache."""

# An allow list: Pillow reads dozens of rare formats whose decoders are little tested.
_FORMATS = ("JPEG", "PNG", "WEBP", "BMP", "GIF", "TIFF") + (
    ("AVIF",) if "avif" in features.modules and features.check_module("avif") else ()
)

_ALLOWED = f"{', '.join(_FORMATS[:-1])} or {_FORMATS[-1]}"
_UNKNOWN = "is not a picture of an allowed format, or its first part is damaged"
_RESAVE = "open it in an image viewer and save it again as PNG or JPEG"

_FOREIGN = (
    (rb"\s*%PDF", "a PDF document"),
    (rb"(?s).*<svg\b", "an SVG drawing"),
    (rb"(?s).*<(!doctype )?html\b", "a web page"),
    (rb"(?s)....ftyp(hei|hev|mif1|msf1)", "a HEIC photo"),
    (rb"[\t\n\r\x20-\x7e]+\Z", "plain text"),
)

_TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}


# Arrays have no single truth value, so a generated __eq__ would raise; compare sha256.
@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as a person sees it; compare two by `sha256`.

    Attributes:
        pixels: (H, W, 3) uint8 RGB, read-only, row 0 at the top, column 0 at the left.
        sha256: hex digest of the file's bytes, or of shape and pixels for an array.
        name: file name, for messages.
        notes: what a person should know about how the pixels came about; often empty.
        path: absolute path of the file it was loaded from, if any.
        file: the file's content, if it was given as bytes rather than by path.
        place: its place on a map, of a GeoTIFF.
    """

    pixels: NDArray[np.uint8]
    sha256: str
    name: str
    notes: tuple[str, ...]
    path: Path | None = None
    file: bytes | None = None
    place: Georeference | None = None

    @property
    def metres_per_pixel(self) -> float | None:
        """The scale its file gives, if any; a print resolution (DPI) says nothing of the ground."""
        return None if self.place is None else self.place.metres_per_pixel

    @property
    def width(self) -> int:
        """Width in pixels."""
        return self.pixels.shape[1]

    @property
    def height(self) -> int:
        """Height in pixels."""
        return self.pixels.shape[0]

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width, self.height


def load_picture(path: str | os.PathLike[str]) -> Picture:
    """Read a picture file of at most 64 MiB, as `picture_from_bytes` does.

    Raises:
        ImageError: it is missing, unreadable, not a regular file or too large, or
            `picture_from_bytes` refuses it.
    """
    shown = os.fspath(path)
    try:
        data = _file_bytes(Path(path), shown)
    except (OSError, ValueError) as error:
        raise _unreadable(shown, error) from None
    picture = picture_from_bytes(data, Path(path).name)
    return replace(picture, path=Path(path).resolve(), file=None)


def picture_from_bytes(data: bytes, name: str) -> Picture:
    """Decode a picture file's bytes; `name` is the file name for messages.

    EXIF orientation is applied, transparent parts are shown on white, the first of several frames
    is used, and more than 8 bits are reduced to 8 by `as_8_bits`. Colour profiles are not applied.

    Raises:
        ImageError: there are no bytes or too many, their format is not allowed, they are damaged,
            or the picture has under 16 or over 20,000 pixels on a side or over 50 megapixels.
    """
    if not data:
        raise _empty(name)
    _check_bytes(name, len(data))
    pixels, place, notes = _decode(data, name)
    sha256 = hashlib.sha256(data).hexdigest()
    return Picture(pixels, sha256, name, notes, file=data, place=place)


def picture_from_array(pixels: NDArray[np.uint8], name: str = "array") -> Picture:
    """Copy an array of (H, W, 3) RGB or (H, W) grey uint8 into a Picture.

    Raises:
        ImageError: another dtype or shape, or a size that `picture_from_bytes` refuses.
    """
    if pixels.dtype != np.uint8 or pixels.ndim not in (2, 3) or pixels.shape[2:] not in ((), (3,)):
        raise _image_error(
            name,
            f"is an array of {pixels.dtype} with shape {pixels.shape}",
            "give uint8 of shape (height, width, 3) or (height, width)",
        )
    _check_size(name, pixels.shape[1], pixels.shape[0])
    grey = pixels.ndim == 2
    copy = np.repeat(pixels[:, :, None], 3, axis=2) if grey else np.array(pixels, order="C")
    copy.setflags(write=False)
    digest = hashlib.sha256(repr(copy.shape).encode())
    digest.update(copy.tobytes())
    return Picture(copy, digest.hexdigest(), name, ())


def picture_file(picture: Picture) -> bytes:
    """Return the content of a file that holds the picture.

    It is the file that the picture came from if that is unchanged, else a PNG of its pixels.
    """
    if picture.path is not None:
        with suppress(ImageError, OSError, ValueError):
            data = _file_bytes(picture.path, picture.name)
            if hashlib.sha256(data).hexdigest() == picture.sha256:
                return data
    if picture.file is not None:
        return picture.file
    file = BytesIO()
    Image.fromarray(picture.pixels).save(file, "PNG")
    return file.getvalue()


def picture_from_file(data: bytes, name: str, sha256: str) -> Picture:
    """Restore the picture with a hash from the file content that `picture_file` returned.

    The picture may have come from a file or an array.

    Raises:
        ImageError: as for `picture_from_bytes`.
    """
    picture = picture_from_bytes(data, name)
    return picture if picture.sha256 == sha256 else picture_from_array(picture.pixels, name)


def _image_error(name: str, problem: str, remedy: str) -> ImageError:
    return ImageError(f"{name!r} {problem}; {remedy}.")


def _empty(name: str) -> ImageError:
    return _image_error(name, "is empty (0 bytes)", f"give a {_ALLOWED} picture")


def _file_bytes(path: Path, shown: str) -> bytes:
    info = path.stat()
    if stat.S_ISDIR(info.st_mode):
        raise _image_error(shown, "is a folder", "give the path of one picture file")
    # Reading a pipe can wait for ever, and a device such as /dev/zero never ends.
    if not stat.S_ISREG(info.st_mode):
        raise _image_error(shown, "is a device or pipe", "give the path of a regular picture file")
    if info.st_size == 0:
        raise _empty(shown)
    _check_bytes(shown, info.st_size)
    with path.open("rb") as file:
        # Bounded, because the file may have grown since its size was checked.
        return file.read(MAX_FILE_BYTES + 1)


def _unreadable(shown: str, error: Exception) -> ImageError:
    if isinstance(error, (FileNotFoundError, NotADirectoryError)):
        return _image_error(shown, "does not exist", "check the spelling of the path")
    if isinstance(error, PermissionError):
        return _image_error(
            shown, "may not be read: permission denied", "allow reading, or copy it"
        )
    reason = (error.strerror if isinstance(error, OSError) else None) or str(error)
    return _image_error(shown, f"cannot be read ({reason})", "check the path of the picture file")


def _check_bytes(name: str, count: int) -> None:
    if count > MAX_FILE_BYTES:
        raise _image_error(
            name,
            f"is too large: {count / 2**20:,.1f} MiB",
            f"at most {MAX_FILE_BYTES // 2**20} MiB are allowed, so save a smaller copy",
        )


def _check_size(name: str, width: int, height: int) -> None:
    if min(width, height) < MIN_SIDE:
        raise _image_error(
            name,
            f"is too small: {width} x {height} pixels",
            f"give a picture of at least {MIN_SIDE} pixels on each side",
        )
    if max(width, height) > MAX_SIDE or width * height > MAX_PIXELS:
        raise _too_many_pixels(name, f"{width} x {height} pixels")


def _too_many_pixels(name: str, claim: str) -> ImageError:
    return _image_error(
        name,
        f"is too large: {claim}",
        f"at most {MAX_PIXELS // 10**6} megapixels and {MAX_SIDE:,} pixels on a side are "
        "allowed, so save a smaller copy",
    )


def _decode(
    data: bytes, name: str
) -> tuple[NDArray[np.uint8], Georeference | None, tuple[str, ...]]:
    try:
        with _pillow_silenced(), Image.open(BytesIO(data), formats=_FORMATS) as opened:
            _check_size(name, *opened.size)
            _check_tiles(name, opened)
            frames = _frames_note(opened)
            colours = data if ";16" in str(opened.tile) else None  # load() clears the tiles
            opened.load()
            # Some decoders learn the true size only now.
            _check_size(name, *opened.size)
            shallow, deep = as_8_bits(opened, colours)
            upright = _upright(shallow, opened)
            place = georeference_of(opened) if upright is shallow else None
            pixels, note = _to_rgb(upright)
    except ImageError:
        raise
    # Over the years Pillow's readers have raised nearly every built-in exception.
    except Exception as error:
        raise _undecodable(name, data, error) from None
    pixels.setflags(write=False)
    mapped = place.note if place is not None else ""
    return pixels, place, tuple(text for text in (frames, deep, note, mapped) if text)


@contextmanager
def _pillow_silenced() -> Generator[None]:
    """Hide Pillow's warnings, and the one error it logs, from the user within the context."""
    logger = logging.getLogger(TiffImagePlugin.__name__)

    def drop(_: logging.LogRecord) -> bool:
        return False

    logger.addFilter(drop)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.removeFilter(drop)


def _undecodable(name: str, data: bytes, error: Exception) -> ImageError:
    if isinstance(error, UnidentifiedImageError):
        what = next((text for pattern, text in _FOREIGN if re.match(pattern, data[:512], re.I)), "")
        problem = f"is {what}, not a picture of an allowed format" if what else _UNKNOWN
        return _image_error(name, problem, f"give a {_ALLOWED} file")
    if isinstance(error, Image.DecompressionBombError):
        return _too_many_pixels(name, "its header claims a vast picture")
    if isinstance(error, MemoryError):
        return _image_error(name, "needs more memory than there is", "save a smaller copy")
    return _image_error(
        name, "cannot be decoded: it is damaged, cut short or has oversized metadata", _RESAVE
    )


def _check_tiles(name: str, opened: Image.Image) -> None:
    """Refuse a small TIFF with a vast tile, for which libtiff would allocate memory."""
    if isinstance(opened, TiffImagePlugin.TiffImageFile):
        tags = opened.tag_v2
        width = tags.get(TiffImagePlugin.TILEWIDTH, 0)
        length = tags.get(TiffImagePlugin.TILELENGTH, 0)
        if width * length > MAX_PIXELS:
            raise _too_many_pixels(name, f"a tile of {width} x {length} pixels")


def _frames_note(opened: Image.Image) -> str:
    # Frames are not counted: that walks the whole file, which takes minutes for a hostile one.
    # MPO is a phone's JPEG with a gain map or preview behind it, which a person would not call a
    # frame.
    several = opened.format != "MPO" and getattr(opened, "is_animated", False)
    return "first of several frames" if several else ""


def _upright(image: Image.Image, opened: Image.Image) -> Image.Image:
    try:
        turn = _TURNS.get(opened.getexif().get(ExifTags.Base.Orientation, 1))
    # Broken EXIF says nothing about the pixels, which are already decoded.
    except Exception:
        return image
    return image if turn is None else image.transpose(turn)


def _to_rgb(image: Image.Image) -> tuple[NDArray[np.uint8], str]:
    """Return the RGB pixels (H, W, 3) and a note, which may be empty."""
    note = ""
    if image.has_transparency_data:
        image = image.convert("RGBA")
        if image.getchannel("A").getextrema() != (255, 255):
            note = "transparent parts shown on white"
        canvas = Image.new("RGB", image.size, "white")
        canvas.paste(image, mask=image)
        image = canvas
    return _pixels_of(image if image.mode == "RGB" else image.convert("RGB")), note


def _pixels_of(image: Image.Image) -> NDArray[np.uint8]:
    """Return an RGB picture's pixels (H, W, 3); Pillow's own way makes two more copies of them."""
    pixels = np.empty((image.height, image.width, 3), dtype=np.uint8)
    for top in range(0, image.height, STRIP):
        bottom = min(top + STRIP, image.height)
        pixels[top:bottom] = np.asarray(image.crop((0, top, image.width, bottom)))
    return pixels
