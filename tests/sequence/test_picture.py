"""A picture's header is read before anything is made of it."""

import struct

import cv2
import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.geometry.camera import Pinhole
from vobench.sequence.picture import (
    BAYER,
    MONO,
    PNG_START,
    RGB,
    decode,
    encode,
    grey,
    header,
    require_picture,
    rgb,
    write_png,
)

CAMERA = Pinhole(48, 32, 40.5, 41.25, 23.5, 15.5)
HUFFMAN_TABLES, START_OF_SCAN = 0xC4, 0xDA
GREY = np.random.default_rng(0).integers(0, 256, (32, 48), np.uint8)


def coded(end, picture, *options):
    return cv2.imencode(end, picture, list(options))[1].tobytes()


@pytest.mark.parametrize(
    ("form", "options"),
    [
        ("png", ()),
        ("jpeg", ()),
        ("jpeg", (cv2.IMWRITE_JPEG_PROGRESSIVE, 1)),
        ("jpeg", (cv2.IMWRITE_JPEG_RST_INTERVAL, 2)),
    ],
)
def test_form_and_size_are_in_the_header(form, options):
    assert require_picture(coded(f".{form}", GREY, *options), CAMERA, "a") == (form, 32, 48)


@pytest.mark.parametrize("form", [".png", ".jpeg"])
def test_colour_is_refused(form):
    with pytest.raises(SequenceError, match=r"^not an 8-bit grey PNG or JPEG: a$"):
        require_picture(coded(form, np.dstack([GREY] * 3)), CAMERA, "a")


def test_sixteen_bits_text_and_nothing_are_refused():
    for encoded in (coded(".png", GREY.astype(np.uint16)), b"P5 48 32 255", b""):
        with pytest.raises(SequenceError, match="not an 8-bit grey PNG or JPEG"):
            decode(encoded, None, "a")


def test_another_size_is_refused_with_both():
    with pytest.raises(SequenceError, match=r"^\(31, 48\) pixels, but the camera has \(32, 48\): a$"):
        decode(coded(".png", GREY[1:]), CAMERA, "a")


@pytest.mark.parametrize("form", [".png", ".jpeg"])
def test_a_picture_cut_within_its_header_is_refused(form):
    with pytest.raises(SequenceError, match=r"the image ends within its header: a"):
        require_picture(coded(form, GREY)[:20], CAMERA, "a")


def test_a_header_that_states_a_billion_pixels_costs_nothing():
    data = bytearray(coded(".png", GREY))
    struct.pack_into(">II", data, 16, 1 << 15, 1 << 15)
    with pytest.raises(SequenceError, match="not an 8-bit grey PNG or JPEG"):
        decode(bytes(data), None, "a")


def test_png_comes_back_bit_for_bit_from_bytes_and_from_a_view_of_them():
    encoded = encode(GREY, CAMERA, "a")
    for form in (encoded, memoryview(encoded), np.frombuffer(encoded, np.uint8)):
        np.testing.assert_array_equal(decode(form, CAMERA, "a"), GREY)


def test_the_size_is_found_behind_the_tables_that_some_write_before_it():
    whole = coded(".jpeg", GREY)
    segments, at = [], 2
    while whole[at + 1] != START_OF_SCAN:
        end = at + 2 + int.from_bytes(whole[at + 2 : at + 4])
        segments.append(whole[at:end])
        at = end
    segments.sort(key=lambda segment: segment[1] != HUFFMAN_TABLES)
    assert segments[0][1] == HUFFMAN_TABLES
    moved = b"".join((whole[:2], *segments, whole[at:]))
    assert require_picture(moved, CAMERA, "a") == ("jpeg", 32, 48)
    np.testing.assert_array_equal(decode(moved, CAMERA, "a"), decode(whole, CAMERA, "a"))


def test_a_colour_picture_comes_back_as_it_went_in_and_its_file_begins_with_red() -> None:
    image = np.zeros((CAMERA.height_px, CAMERA.width_px, 3), np.uint8)
    image[..., 0], image[:, ::2, 2] = 200, 90
    encoded = encode(image, CAMERA, "a", colour=RGB)
    np.testing.assert_array_equal(decode(encoded, CAMERA, "a", colour=RGB), image)
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR)[..., 2], 200)
    with pytest.raises(SequenceError, match="not an 8-bit grey PNG"):
        decode(encoded, CAMERA, "a")
    with pytest.raises(SequenceError, match="takes"):
        encode(image, CAMERA, "a")


@pytest.mark.parametrize("colour", [MONO, RGB, BAYER])
def test_white_is_grey_and_rgb_alike_in_every_form(colour: str) -> None:
    shape = (8, 8, 3) if colour == RGB else (8, 8)
    image = np.full(shape, 120, np.uint8)
    np.testing.assert_array_equal(grey(image, colour), np.full((8, 8), 120))
    np.testing.assert_array_equal(rgb(image, colour), np.full((8, 8, 3), 120))


def test_a_mosaic_begins_with_red() -> None:
    raw = np.zeros((8, 8), np.uint8)
    raw[::2, ::2] = 200
    red, green, blue = rgb(raw, BAYER)[2:6, 2:6].reshape(-1, 3).mean(0).tolist()
    assert red > 150
    assert max(green, blue) == 0


def test_what_is_neither_png_nor_jpeg_has_an_empty_header() -> None:
    for data in (b"", b"hello, this is no image", b"\xff\xd8\xff\xe0\x00\x04\x00\x00junk that is no marker"):
        assert header(memoryview(data)) == ("", 0, 0, 0, 0)
    palette = struct.pack(">IIBB", 7, 5, 2, 3)
    assert header(memoryview(PNG_START + palette)) == ("png", 5, 7, 8, 3)
    assert header(memoryview(PNG_START + struct.pack(">IIBB", 7, 5, 16, 5))) == ("png", 5, 7, 16, 0)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_written_png_has_the_channels_in_their_order(tmp_path, dtype) -> None:
    red_green_blue = np.random.default_rng(4).integers(0, np.iinfo(dtype).max, (6, 8, 3), dtype)
    write_png(tmp_path / "a.png", red_green_blue)
    read = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read[..., ::-1], red_green_blue)
    write_png(tmp_path / "b.png", red_green_blue[..., 0])
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "b.png"), cv2.IMREAD_UNCHANGED), red_green_blue[..., 0])


def test_a_colour_picture_of_another_shape_is_refused() -> None:
    with pytest.raises(SequenceError, match=r"^a takes \(32, 48, 3\) uint8 images, got \(32, 48\) uint8$"):
        encode(GREY, CAMERA, "a", colour=RGB)
    assert decode(encode(GREY, None, "a"), None, "a").shape == (32, 48)
