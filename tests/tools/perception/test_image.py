import hashlib
import os
import random
import struct
import warnings
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from formup.tools.errors import ImageError
from formup.tools.perception.image import load_picture, picture_from_array, picture_from_bytes
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin, features

Y, X = np.mgrid[0:24, 0:32]
RGB = np.stack([X * 8, Y * 10, X * Y % 256], axis=-1).astype(np.uint8)
COLOUR = Image.fromarray(RGB)
FORMATS = ["JPEG", "PNG", "WEBP", "BMP", "GIF", "TIFF"]
if "avif" in features.modules and features.check_module("avif"):
    FORMATS.append("AVIF")


def encoded(image: Image.Image, form: str, **options: Any) -> bytes:
    buffer = BytesIO()
    image.save(buffer, form, **options)
    return buffer.getvalue()


def pixels(image: Image.Image, form: str, **options: Any) -> NDArray[np.uint8]:
    return picture_from_bytes(encoded(image, form, **options), "x").pixels


def grey(values: NDArray[Any], form: str) -> NDArray[np.uint8]:
    shown = pixels(Image.fromarray(values), form)
    assert np.ptp(shown, axis=2).max() == 0
    return shown[:, :, 0]


def refusal(call: Callable[[], object], name: str) -> str:
    """The one sentence of the ImageError, checked for form."""
    with pytest.raises(ImageError) as caught:
        call()
    error, text = caught.value, str(caught.value)
    assert type(error) is ImageError
    assert error.__suppress_context__ or error.__context__ is None
    assert repr(name) in text
    assert "\n" not in text
    assert text.endswith(".")
    assert "; " in text
    return text


def refused(data: bytes) -> str:
    return refusal(lambda: picture_from_bytes(data, "bad.img"), "bad.img")


def png(width: int, height: int, *extra: tuple[bytes, bytes], rows: bytes = b"") -> bytes:
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), *extra, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in chunks
    )


def gif(screen: tuple[int, int], frame: tuple[int, int, int, int]) -> bytes:
    head = b"GIF89a" + struct.pack("<HHBBB", *screen, 0x80, 0, 0) + b"\0\0\0\xff\xff\xff"
    return head + b"," + struct.pack("<HHHHB", *frame, 0) + b"\x02\x02\x4c\x01\0;"


def tiff(data: bytes, **changes: int) -> bytes:
    tags = {256: 64, 257: 64, 258: 8, 259: 1, 262: 1, 277: 1, 273: 0, 279: len(data)}
    tags |= {int(key[1:]): value for key, value in changes.items()}
    start = 8 + 2 + 12 * len(tags) + 4
    tags |= {key: start for key in (273, 324) if key in tags}
    entries = b"".join(struct.pack("<HHII", key, 4, 1, tags[key]) for key in sorted(tags))
    return b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(4) + data


@pytest.mark.parametrize("form", FORMATS)
def test_every_format_loads(form: str, tmp_path: Path) -> None:
    path = tmp_path / "a picture.bin"
    path.write_bytes(encoded(COLOUR, form))
    picture = load_picture(path)
    assert picture.pixels.shape == (24, 32, 3)
    assert picture.pixels.dtype == np.uint8
    assert (picture.width, picture.height, picture.size) == (32, 24, (32, 24))
    assert picture.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert picture.name == "a picture.bin"
    assert picture.notes == ()
    assert np.abs(picture.pixels.astype(int) - RGB).mean() < 25
    assert load_picture(str(path)).sha256 == picture.sha256


def test_pixels_are_read_only() -> None:
    for picture in (picture_from_bytes(encoded(COLOUR, "PNG"), "x"), picture_from_array(RGB)):
        with pytest.raises(ValueError, match="read-only"):
            picture.pixels[0, 0] = 0


STORED: dict[int, Callable[[NDArray[np.uint8]], NDArray[np.uint8]]] = {
    1: lambda a: a,
    2: lambda a: a[:, ::-1],
    3: lambda a: a[::-1, ::-1],
    4: lambda a: a[::-1],
    5: lambda a: a.transpose(1, 0, 2),
    6: lambda a: np.rot90(a, 1),
    7: lambda a: a[::-1, ::-1].transpose(1, 0, 2),
    8: lambda a: np.rot90(a, -1),
}


@pytest.mark.parametrize("form", ["PNG", "WEBP", "TIFF"])
@pytest.mark.parametrize("orientation", STORED)
def test_orientation_is_applied(form: str, orientation: int) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    stored = Image.fromarray(np.ascontiguousarray(STORED[orientation](RGB)))
    options = {"lossless": True} if form == "WEBP" else {}
    assert np.array_equal(pixels(stored, form, exif=exif, **options), RGB)


@pytest.mark.parametrize("exif", [b"Exif\0\0garbage!", b"junk", b"Exif\0\0II*\0\xff\xff\xff\xff"])
def test_broken_exif_is_no_obstacle(exif: bytes) -> None:
    for form in ("JPEG", "PNG", "WEBP"):
        assert pixels(COLOUR, form, exif=exif).shape == RGB.shape
    assert picture_from_bytes(tiff(bytes(64 * 64), t34665=2**31), "x").size == (64, 64)


def test_alpha_is_shown_on_white() -> None:
    alpha = Image.new("L", COLOUR.size)
    alpha.paste(255, (16, 0, 32, 24))
    hidden = COLOUR.copy()
    hidden.putalpha(alpha)
    for image in (hidden, hidden.convert("LA")):
        picture = picture_from_bytes(encoded(image, "PNG"), "x")
        assert picture.pixels[:, :16].min() == 255
        assert picture.pixels[:, 16:].min() < 50
        assert picture.notes == ("transparent parts shown on white",)
    half = Image.new("RGBA", (16, 16), (0, 0, 0, 128))
    assert set(pixels(half, "PNG").ravel().tolist()) == {127}
    assert picture_from_bytes(encoded(COLOUR.convert("RGBA"), "PNG"), "opaque").notes == ()


def test_transparent_palette_and_key_colour_are_shown_on_white() -> None:
    palette = Image.new("P", (16, 16), 1)
    palette.putpalette([9, 9, 9, 200, 0, 0])
    palette.paste(0, (0, 0, 16, 8))
    for data in (
        encoded(palette, "PNG", transparency=b"\0\xff"),
        encoded(palette, "GIF", transparency=0),
        encoded(palette.convert("RGB"), "PNG", transparency=(9, 9, 9)),
    ):
        picture = picture_from_bytes(data, "x")
        assert picture.pixels[0, 0].tolist() == [255, 255, 255]
        assert picture.pixels[15, 0].tolist() == [200, 0, 0]
        assert picture.notes == ("transparent parts shown on white",)


@pytest.mark.parametrize("mode", ["CMYK", "L", "1", "P"])
def test_modes_become_rgb(mode: str) -> None:
    image = COLOUR.convert(mode)
    assert np.array_equal(pixels(image, "TIFF"), np.asarray(image.convert("RGB")))


def test_white_stays_white_in_rarer_colour_spaces() -> None:
    assert pixels(Image.new("CMYK", (16, 16)), "JPEG").min() >= 250
    white = Image.merge("LAB", [Image.new("L", (16, 16), level) for level in (255, 128, 128)])
    assert pixels(white, "TIFF").min() >= 250


def test_16_bit_grey_uses_the_full_range() -> None:
    values = np.linspace(0, 65535, 256).astype(np.uint16).reshape(16, 16)
    for form in ("PNG", "TIFF"):
        assert np.array_equal(grey(values, form).ravel(), np.arange(256))


@pytest.mark.parametrize(("kind", "low", "high"), [(np.uint16, 96, 4095), (np.int32, -9, 999)])
def test_grey_beyond_8_bits_is_stretched_with_a_note(kind: Any, low: int, high: int) -> None:
    values = np.linspace(low, high, 256).astype(kind).reshape(16, 16)
    picture = picture_from_bytes(encoded(Image.fromarray(values), "TIFF"), "x")
    assert (picture.pixels.min(), picture.pixels.max()) == (0, 255)
    assert picture.notes == (f"grey values {low} to {high} stretched from black to white",)


def test_deep_grey_within_8_bits_stays() -> None:
    values = np.arange(256).reshape(16, 16) // 2
    for deep in (values.astype(np.int32), values.astype(np.float32)):
        assert np.array_equal(grey(deep, "TIFF"), values)


def test_float_of_0_to_1_is_scaled_without_stretching() -> None:
    values = np.full((16, 16), 0.2, np.float32)
    values[0] = 0.8
    assert np.unique(grey(values, "TIFF")).tolist() == [51, 204]


def test_float_that_is_not_finite() -> None:
    values = np.linspace(-1e38, 3e38, 256, dtype=np.float32).reshape(16, 16)
    values[5, :3] = np.nan, np.inf, -np.inf
    shown = grey(values, "TIFF")
    assert shown[5, :3].tolist() == [0, 255, 0]
    assert (shown[0, 0], shown[15, 15], shown[8, 0]) == (0, 255, 128)
    assert not grey(np.full((16, 16), np.nan, np.float32), "TIFF").any()
    assert not grey(np.full((16, 16), 1e9, np.float32), "TIFF").any()


@pytest.mark.parametrize("form", ["GIF", "WEBP", "PNG", "TIFF"])
def test_first_of_several_frames(form: str) -> None:
    data = encoded(COLOUR, form, save_all=True, append_images=[Image.new("RGB", (32, 24))])
    picture = picture_from_bytes(data, "x")
    assert picture.notes == ("first of several frames",)
    assert picture.pixels.std() > 30


def test_preview_inside_a_phone_photo_is_no_frame() -> None:
    data = encoded(COLOUR, "MPO", save_all=True, append_images=[COLOUR])
    assert picture_from_bytes(data, "x").notes == ()


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    def load(path: Path | str) -> str:
        return refusal(lambda: load_picture(path), str(path))

    file = tmp_path / "empty.png"
    file.touch()
    assert "empty (0 bytes)" in load(file)
    assert "does not exist" in load(tmp_path / "missing.png")
    assert "does not exist" in load(file / "inside.png")
    assert "folder" in load(tmp_path)
    assert "cannot be read" in load("a\0b.png")
    assert "cannot be read" in load("a" * 5000)
    with file.open("wb") as sparse:
        sparse.truncate(64 * 2**20 + 1)
    assert "64 MiB" in load(file)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_pipes_and_devices_are_refused_at_once(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.png"
    os.mkfifo(pipe)
    for path in (str(pipe), "/dev/zero"):
        assert "device or pipe" in refusal(lambda path=path: load_picture(path), path)


def test_permission_denied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "secret.png"
    path.write_bytes(b"x")

    # The administrator may read any file, so file modes would not do here.
    def deny(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", deny)
    assert "permission denied" in refusal(lambda: load_picture(path), str(path))


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"Dear sir,\n", "plain text"),
        (b"%PDF-1.7\n\xff\xff", "PDF"),
        (b'<?xml version="1.0"?>\n<svg xmlns="x"/>', "SVG"),
        (b"\n<!DOCTYPE html><p>", "web page"),
        (b"\0\0\0\x18ftypheic\0\0\0\0", "HEIC"),
        (random.Random(1).randbytes(1000), "first part is damaged"),
        (encoded(COLOUR, "PPM"), "not a picture of an allowed format"),
        (encoded(COLOUR, "ICO"), "not a picture of an allowed format"),
    ],
)
def test_what_is_no_picture(data: bytes, what: str) -> None:
    text = refused(data)
    assert what in text
    assert "give a JPEG, PNG" in text


def test_too_many_bytes() -> None:
    assert "64.0 MiB; at most 64 MiB" in refused(bytes(64 * 2**20 + 1))
    assert "empty" in refused(b"")


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_truncated(form: str, share: float) -> None:
    data = encoded(COLOUR, form)
    text = refused(data[: int(len(data) * share)])
    assert "cut short" in text or "damaged" in text


@pytest.mark.parametrize(
    ("data", "size"),
    [
        (png(10_000, 10_000), "10000 x 10000"),
        (png(40_000, 40_000), "header claims"),
        (png(20_001, 16), "20001 x 16"),
        (gif((9000, 9000), (0, 0, 16, 16)), "9000 x 9000"),
        (gif((16, 16), (0, 0, 9000, 9000)), "9000 x 9000"),
        (gif((16, 16), (60_000, 60_000, 16, 16)), "header claims"),
        (tiff(b"", t256=30_000, t257=2000), "30000 x 2000"),
        (tiff(b"x", t259=8, t322=20_000, t323=20_000, t324=0, t325=1), "tile of 20000 x 20000"),
        (b"BM" + struct.pack("<IIIIiiHHI", 54, 0, 54, 40, 9000, -9000, 1, 24, 0), "9000 x 9000"),
    ],
)
def test_vast_headers(data: bytes, size: str) -> None:
    assert len(data) < 1000
    text = refused(data.ljust(100, b"\0"))
    assert size in text
    assert "at most 50 megapixels and 20,000 pixels on a side" in text


def test_small_and_long_pictures() -> None:
    assert "15 x 16 pixels; give a picture of at least 16" in refused(png(15, 16))
    assert pixels(Image.new("L", (20_000, 16)), "PNG").shape == (16, 20_000, 3)


def test_metadata_bomb() -> None:
    rows = bytes(33 * 32)
    assert picture_from_bytes(png(32, 32, rows=rows), "x").size == (32, 32)
    bomb = (b"zTXt", b"Comment\0\0" + zlib.compress(bytes(5_000_000)))
    assert "oversized metadata" in refused(png(32, 32, bomb, rows=rows))


@pytest.mark.parametrize("kind", [struct.error, zlib.error, AssertionError, MemoryError])
def test_whatever_a_decoder_raises(kind: type[Exception], monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise kind

    data = encoded(COLOUR, "PNG")
    monkeypatch.setattr("PIL.ImageFile.ImageFile.load", fail)
    assert ("needs more memory" if kind is MemoryError else "damaged") in refused(data)


def test_silence_and_no_trace_left(caplog: pytest.LogCaptureFixture) -> None:
    def state() -> tuple[object, ...]:
        logger = TiffImagePlugin.logger
        return Image.MAX_IMAGE_PIXELS, list(warnings.filters), list(logger.filters)

    before = state()
    assert "damaged" in refused(tiff(bytes(64 * 64), t277=900))
    assert "10000" in refused(png(10_000, 10_000))
    picture_from_bytes(tiff(bytes(64 * 64), t34665=2**31), "x")
    assert not caplog.records
    assert state() == before


def test_from_array_copies_and_hashes() -> None:
    source = RGB.copy()
    picture = picture_from_array(source)
    source[:] = 0
    assert np.array_equal(picture.pixels, RGB)
    assert (picture.name, picture.notes, picture.size) == ("array", (), (32, 24))
    assert picture.sha256 == picture_from_array(RGB[:, ::1], "other").sha256
    assert picture.sha256 != picture_from_array(RGB.reshape(32, 24, 3)).sha256
    upside_down = picture_from_array(RGB[::-1])
    assert upside_down.pixels.flags.c_contiguous
    assert upside_down.sha256 != picture.sha256
    grey_twin = picture_from_array(RGB[:, :, 0])
    assert np.array_equal(grey_twin.pixels, RGB[:, :, [0, 0, 0]])
    assert grey_twin.sha256 == picture_from_array(RGB[:, :, [0, 0, 0]]).sha256


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (RGB.astype(np.float64), "array of float64"),
        (RGB[:, :, :2], "shape (24, 32, 2)"),
        (RGB[None], "shape (1, 24, 32, 3)"),
        (RGB[0, 0], "shape (3,)"),
        (RGB[:15], "32 x 15"),
        (np.broadcast_to(RGB[:1, :1], (8000, 8000, 3)), "8000 x 8000"),
    ],
)
def test_from_bad_array(array: NDArray[Any], words: str) -> None:
    assert words in refusal(lambda: picture_from_array(array, "view"), "view")


def damaged(data: bytes, chance: random.Random) -> bytes:
    if chance.random() < 0.2:
        return data[: chance.randrange(1, len(data))]
    broken = bytearray(data)
    for _ in range(chance.choice([1, 2, 8])):
        broken[chance.randrange(chance.choice([64, len(data)]))] = chance.randrange(256)
    return bytes(broken)


@pytest.mark.parametrize("form", [*FORMATS, "MPO"])
def test_damage_gives_a_picture_or_an_image_error(form: str) -> None:
    chance = random.Random(form)
    data = encoded(COLOUR, form, save_all=form not in ("JPEG", "BMP"))
    for _ in range(400):
        try:
            picture = picture_from_bytes(damaged(data, chance), "x")
        except ImageError as error:
            assert str(error).startswith("'x' ")
        else:
            assert picture.pixels.shape == (picture.height, picture.width, 3)
