"""Pictures of all kinds come to 8-bit grey, or to a sentence."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from vobench.dataset.picture import EncodedPicture, as_file, conversions, grey, kind_of, unread
from vobench.errors import VobenchError

RNG = np.random.default_rng(4)
GREY = RNG.integers(0, 256, (24, 36), np.uint8)
COLOUR = RNG.integers(0, 256, (24, 36, 3), np.uint8)


def encoded(pixels, ending=".png") -> EncodedPicture:
    return EncodedPicture(f"a{ending}", cv2.imencode(ending, pixels)[1].tobytes())


def as_grey(picture):
    return grey(picture, kind_of(picture))


@pytest.mark.parametrize("ending", [".png", ".jpg"])
def test_a_grey_file_is_handed_on_as_it_is(ending):
    picture = encoded(GREY, ending)
    data, form = as_file(picture, kind_of(picture))
    assert data == picture.content
    assert form == {".png": "png", ".jpg": "jpeg"}[ending]
    assert conversions(kind_of(picture)) == ()


def test_grey_is_the_weighted_sum_of_colours():
    blue, green, red = np.moveaxis(COLOUR.astype(float), -1, 0)
    expected = 0.299 * red + 0.587 * green + 0.114 * blue
    assert np.abs(as_grey(encoded(COLOUR)) - expected).max() <= 0.51
    assert np.array_equal(as_grey(EncodedPicture("pixels", COLOUR)), as_grey(encoded(COLOUR)))


@pytest.mark.parametrize("factor", [256, 257])
def test_16_bits_give_back_8_however_they_were_widened(factor):
    wide = GREY.astype(np.uint16) * factor
    assert np.array_equal(as_grey(encoded(wide)), GREY)
    data, form = as_file(encoded(wide), kind_of(encoded(wide)))
    assert form == "png"
    assert np.array_equal(as_grey(EncodedPicture("again", data)), GREY)


def test_an_alpha_channel_makes_no_difference_but_for_a_note():
    with_alpha = encoded(np.dstack([COLOUR, GREY]))
    assert np.array_equal(as_grey(with_alpha), as_grey(encoded(COLOUR)))
    assert "The alpha channel of the images was dropped." in conversions(kind_of(with_alpha))


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def by_hand(width, height, bits, colour, rows: bytes, *more: bytes) -> EncodedPicture:
    header = struct.pack(">IIBBBBB", width, height, bits, colour, 0, 0, 0)
    chunks = chunk(b"IHDR", header) + b"".join(more) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return EncodedPicture("by hand", b"\x89PNG\r\n\x1a\n" + chunks)


def test_kinds_of_png_that_opencv_does_not_write():
    palette = by_hand(2, 1, 8, 3, b"\x00\x00\x01", chunk(b"PLTE", bytes([10, 10, 10, 200, 200, 200])))
    assert as_grey(palette).tolist() == [[10, 200]]
    one_bit = by_hand(8, 1, 1, 0, b"\x00\xa0")
    assert as_grey(one_bit).tolist() == [[255, 0, 255, 0, 0, 0, 0, 0]]
    grey_alpha = by_hand(2, 1, 8, 4, b"\x00\x07\xff\x09\x00")
    assert as_grey(grey_alpha).tolist() == [[7, 9]]
    transparent = by_hand(2, 1, 8, 0, b"\x00\x07\x09", chunk(b"tRNS", b"\x00\x07"))
    assert as_grey(transparent).tolist() == [[7, 9]]
    assert as_file(transparent, kind_of(transparent))[0] != transparent.content  # a reader would see four channels


def test_a_header_that_asks_for_the_moon_costs_nothing():
    for width, height in ((2**31 - 1, 2**31 - 1), (0, 4)):
        with pytest.raises(VobenchError, match="an image should have 1 to 67108864 pixels, but has "):
            kind_of(by_hand(width, height, 8, 0, b""))


@pytest.mark.parametrize(
    "data", [b"", b"GIF89a", b"\xff\xd8\xff\xd9", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0\xff\xd9"]
)
def test_what_is_no_picture_is_said(data):
    with pytest.raises(VobenchError, match=r": here\.png$"):
        kind_of(EncodedPicture("here.png", data))


@given(st.sampled_from([".png", ".jpg"]), st.booleans(), st.data())
@example(".jpg", True, None)
def test_spoilt_bytes_are_a_picture_or_a_sentence(ending, colour, data):
    """A flip in a JPEG's pixels is another picture; in a PNG every flip is seen."""
    picture = encoded(COLOUR if colour else GREY, ending)
    spoilt = bytearray(picture.content)
    if data is not None:
        for _ in range(data.draw(st.integers(1, 4))):
            spoilt[data.draw(st.integers(0, len(spoilt) - 1))] ^= data.draw(st.integers(1, 255))
        spoilt = spoilt[: data.draw(st.integers(0, len(spoilt)))]
    try:
        result = as_grey(EncodedPicture("spoilt", bytes(spoilt)))
    except VobenchError:
        return
    assert result.dtype == np.uint8
    assert ending == ".jpg"


def test_what_was_not_read_is_named_but_hidden_files_are_not(tmp_path):
    for name in ("used", "b", "a", ".hidden"):
        (tmp_path / name).touch()
    assert unread(tmp_path, "used") == ("Not read: a, b.",)
    assert unread(tmp_path, "used", "a", "b") == ()


@pytest.mark.parametrize(
    ("pixels", "text", "is_grey8"),
    [
        (np.zeros((2, 3), np.uint8), "3 x 2 pixels, 8-bit grey", True),
        (np.zeros((2, 3, 3), np.uint8), "3 x 2 pixels, 8-bit colour", False),
        (np.zeros((2, 3), np.uint16), "3 x 2 pixels, 16-bit grey", False),
    ],
)
def test_pixels_have_a_kind_as_files_have(pixels, text, is_grey8):
    kind = kind_of(EncodedPicture("x", pixels))
    assert str(kind) == text
    assert kind.is_grey8 == is_grey8
    form = as_file(EncodedPicture("x", pixels), kind)[1]
    assert form == "png"
