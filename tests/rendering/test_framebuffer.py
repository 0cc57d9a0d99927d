"""Framebuffers are cleared and drawn inside a box, and are read from the top row on."""

from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("OpenGL.GL")

from OpenGL import GL

from vobench.errors import RenderError
from vobench.rendering.framebuffer import framebuffer, layered_framebuffer
from vobench.rendering.gl_state import set_initial_state
from vobench.rendering.sample_pattern import PIXEL_CENTRE, ROTATED_GRID

WIDTH_PX = 5
HEIGHT_PX = 3
TOP_LEFT = (0, 2, 0, 1)  # columns 0 to 1 of row 0


@pytest.fixture(autouse=True, scope="module")
def initial_state(gl_context: None) -> None:
    set_initial_state()


@pytest.fixture(autouse=True)
def white() -> Iterator[None]:
    """Clearing fills with white."""
    GL.glClearColor(1, 0.5, 0.25, 1)
    yield
    GL.glClearColor(0, 0, 0, 0)


@pytest.mark.parametrize("channels", [1, 3])
def test_only_the_box_is_cleared_and_rows_count_from_the_top(channels: int) -> None:
    picture = framebuffer(WIDTH_PX, HEIGHT_PX, channels)
    GL.glClearColor(0, 0, 0, 0)
    picture.clear(picture.whole)
    GL.glClearColor(1, 0.5, 0.25, 1)
    picture.clear(TOP_LEFT)
    colours = picture.read(picture.whole).reshape(HEIGHT_PX, WIDTH_PX, channels)
    expected = np.zeros((HEIGHT_PX, WIDTH_PX, channels))
    expected[0, :2] = [1, 0.5, 0.25][:channels]
    np.testing.assert_array_equal(colours, expected)


def test_a_box_is_read_like_the_same_part_of_the_whole() -> None:
    picture = framebuffer(WIDTH_PX, HEIGHT_PX, 1)
    picture.clear((1, 4, 1, 2))
    whole = picture.read(picture.whole)
    np.testing.assert_array_equal(picture.read((1, 5, 0, 2)), whole[0:2, 1:5])


def test_what_is_read_is_a_new_array() -> None:
    picture = framebuffer(WIDTH_PX, HEIGHT_PX, 1)
    picture.clear(picture.whole)
    first = picture.read(picture.whole)
    first[:] = 7
    assert (picture.read(picture.whole) == 1).all()


def test_a_layered_framebuffer_has_one_layer_for_each_sample() -> None:
    for pattern in (ROTATED_GRID, PIXEL_CENTRE):
        assert layered_framebuffer(2, 2, pattern, 1).layers == len(pattern.positions)
    assert layered_framebuffer(2, 2, PIXEL_CENTRE, 1).is_mono
    assert not layered_framebuffer(2, 2, PIXEL_CENTRE, 3).is_mono


def test_clearing_a_layered_framebuffer_puts_the_box_at_infinity_in_all_layers() -> None:
    samples = layered_framebuffer(WIDTH_PX, HEIGHT_PX, ROTATED_GRID, 1)
    whole = (0, WIDTH_PX, 0, HEIGHT_PX)
    GL.glClearDepth(0.5)
    samples.clear(whole)
    GL.glClearDepth(0.0)
    samples.clear(TOP_LEFT)
    expected = np.full((HEIGHT_PX, WIDTH_PX), 0.5)
    expected[0, :2] = 0
    np.testing.assert_array_equal(samples.reversed_depth(), expected)


def test_each_viewport_moves_its_sample_to_the_centre_of_the_pixel() -> None:
    samples = layered_framebuffer(WIDTH_PX, HEIGHT_PX, ROTATED_GRID, 1)
    samples.bind((0, WIDTH_PX, 0, HEIGHT_PX))
    for layer, (x, y) in enumerate(ROTATED_GRID.positions):
        viewport = GL.glGetFloati_v(GL.GL_VIEWPORT, layer)
        np.testing.assert_allclose(viewport, [0.5 - x, 0.5 - y, WIDTH_PX, HEIGHT_PX], atol=1 / 256)


def test_a_framebuffer_that_the_driver_refuses_is_an_error_with_its_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(GL, "glCheckFramebufferStatus", lambda target: GL.GL_FRAMEBUFFER_UNSUPPORTED)
    with pytest.raises(RenderError, match="5 x 3 pixels"):
        framebuffer(WIDTH_PX, HEIGHT_PX, 1)
    with pytest.raises(RenderError, match="5 x 3 pixels"):
        layered_framebuffer(WIDTH_PX, HEIGHT_PX, ROTATED_GRID, 1)
