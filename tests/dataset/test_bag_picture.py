from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vobench.dataset.bag_picture import MOSAICS, picture
from vobench.errors import InputError

RNG = np.random.default_rng(3)


def message(encoding: str, pixels: np.ndarray, *, pad: int = 0, big: bool = False, **changes: Any) -> SimpleNamespace:
    height, width = pixels.shape[:2]
    rows = np.frombuffer(pixels.astype(pixels.dtype.newbyteorder(">" if big else "<")).tobytes(), np.uint8)
    rows = np.pad(rows.reshape(height, -1), ((0, 0), (0, pad)), constant_values=7)
    fields = {"height": height, "width": width, "step": rows.shape[1], "is_bigendian": big, "data": rows.ravel()}
    return SimpleNamespace(encoding=encoding, **{**fields, **changes})


@pytest.mark.parametrize("pad", [0, 5])
def test_padded_rows_make_no_difference(pad: int) -> None:
    grey = RNG.integers(0, 256, (6, 8), np.uint8)
    colour = RNG.integers(0, 256, (6, 8, 3), np.uint8)
    np.testing.assert_array_equal(picture(message("MONO8", grey, pad=pad), "x").content, grey)
    np.testing.assert_array_equal(picture(message("bgr8", colour, pad=pad), "x").content, colour)
    np.testing.assert_array_equal(picture(message("rgb8", colour, pad=pad), "x").content, colour[..., ::-1])


def test_alpha_is_dropped_and_red_and_blue_are_in_the_order_of_opencv() -> None:
    pixels = RNG.integers(0, 256, (6, 8, 4), np.uint8)
    np.testing.assert_array_equal(picture(message("bgra8", pixels), "x").content, pixels[..., :3])
    np.testing.assert_array_equal(picture(message("rgba8", pixels), "x").content, pixels[..., 2::-1])


@pytest.mark.parametrize("big", [False, True])
def test_sixteen_bits_keep_their_values_in_either_byte_order(big: bool) -> None:
    pixels = RNG.integers(0, 65536, (6, 8), np.uint16)
    content = picture(message("16UC1", pixels, big=big, pad=3), "x").content
    assert isinstance(content, np.ndarray)
    assert content.dtype == np.uint16
    np.testing.assert_array_equal(content, pixels)


@pytest.mark.parametrize("encoding", MOSAICS)
def test_an_even_mosaic_is_even_grey(encoding: str) -> None:
    content = picture(message(encoding, np.full((6, 8), 90, np.uint8)), "x").content
    assert isinstance(content, np.ndarray)
    assert content.shape == (6, 8)
    assert (content == 90).all()


def test_a_compressed_picture_is_handed_on() -> None:
    data = np.frombuffer(b"\x89PNG and more", np.uint8)
    assert picture(SimpleNamespace(data=data), "x").content == b"\x89PNG and more"


@pytest.mark.parametrize("change", [{"height": 0}, {"width": 0}, {"step": 7}, {"height": 7}, {"width": 9}])
def test_a_size_that_its_bytes_do_not_hold_is_refused(change: dict[str, int]) -> None:
    with pytest.raises(InputError, match=r"^48 bytes are not a \d x \d image in mono8 with \d bytes a row: x$"):
        picture(message("mono8", np.zeros((6, 8), np.uint8), **change), "x")


def test_more_bytes_than_needed_are_passed_over_and_an_unknown_encoding_is_refused() -> None:
    longer = message("mono8", np.zeros((6, 8), np.uint8), data=np.zeros(60, np.uint8))
    assert np.asarray(picture(longer, "x").content).shape == (6, 8)
    with pytest.raises(InputError, match=r"^the encoding 'yuv422' is not supported\. Known: mono8, .*: x$"):
        picture(message("yuv422", np.zeros((6, 8), np.uint8)), "x")
