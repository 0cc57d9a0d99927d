"""A render target has the framebuffers that a picture needs, in grey or in colour."""

import pytest

pytest.importorskip("OpenGL.GL")

from vobench.rendering.render_target import MIRRORS, render_target
from vobench.rendering.sample_pattern import HALVES, ROTATED_GRID
from vobench.scene.material import LUMINANCE

pytestmark = pytest.mark.usefixtures("gl_context")
RED = (1.0, 0.0, 0.0)


def test_there_is_a_framebuffer_for_the_picture_and_one_for_each_mirror_in_a_mirror() -> None:
    target = render_target(6, 4, HALVES[0], LUMINANCE, in_colour=False)
    assert len(target.framebuffers) == 1 + MIRRORS
    assert target.framebuffer is target.framebuffers[0]
    assert len({int(framebuffer.id) for framebuffer in target.framebuffers}) == 1 + MIRRORS
    for framebuffer in target.framebuffers:
        assert (framebuffer.width_px, framebuffer.height_px) == (6, 4)
        assert framebuffer.pattern == HALVES[0]
    assert target.total.whole == (0, 6, 0, 4)


@pytest.mark.parametrize(
    ("weights", "in_colour", "sample_channels", "channels"),
    [(RED, False, 1, 1), (RED, True, 3, 1), (None, False, 3, 3), (None, True, 3, 3)],
)
def test_samples_are_in_colour_if_the_picture_is_or_if_mirrors_are_tinted(
    weights, in_colour: bool, sample_channels: int, channels: int
) -> None:
    target = render_target(6, 4, ROTATED_GRID, weights, in_colour=in_colour)
    assert {framebuffer.channels for framebuffer in target.framebuffers} == {sample_channels}
    assert target.total.channels == channels
    assert target.weights == (weights or LUMINANCE)
