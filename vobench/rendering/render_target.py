"""The framebuffers that a picture is drawn into: one for each depth of mirrors, and one for the sum of sub-frames."""

from dataclasses import dataclass, replace

from vobench.rendering.framebuffer import Framebuffer, LayeredFramebuffer, framebuffer, layered_framebuffer
from vobench.rendering.sample_pattern import SamplePattern
from vobench.rendering.uniform_block import MIRROR_PLANES
from vobench.scene.material import LUMINANCE, Rgb

MIRRORS = MIRROR_PLANES  # the largest number of mirrors that are followed one after another


@dataclass(frozen=True, slots=True)
class RenderTarget:
    """The framebuffers of a picture.

    framebuffers: the first is for the picture, the others for what is seen by way of one mirror, two mirrors and so on.
    total: the weighted sum of the sub-frames.
    weights: of linear red, green and blue, if `total` has one channel.
    """

    framebuffers: tuple[LayeredFramebuffer, ...]
    total: Framebuffer
    weights: Rgb

    @property
    def framebuffer(self) -> LayeredFramebuffer:
        """The framebuffer of the picture itself."""
        return self.framebuffers[0]

    def with_pattern(self, pattern: SamplePattern) -> "RenderTarget":
        """The same framebuffers with other positions of as many samples."""
        framebuffers = [replace(framebuffer, pattern=pattern) for framebuffer in self.framebuffers]
        return replace(self, framebuffers=tuple(framebuffers))


def render_target(
    width_px: int,
    height_px: int,
    pattern: SamplePattern,
    weights: Rgb | None,
    *,
    in_colour: bool,
) -> RenderTarget:
    """Create the framebuffers for pictures of a size, with one channel or, without weights, three.

    in_colour: whether the samples have three channels in either case, as they need if mirrors are tinted.

    Raises RenderError if the driver does not support them.
    """
    channels = 3 if weights is None else 1
    sample_channels = 3 if in_colour else channels
    framebuffers = [layered_framebuffer(width_px, height_px, pattern, sample_channels) for _ in range(1 + MIRRORS)]
    total = framebuffer(width_px, height_px, channels)
    return RenderTarget(tuple(framebuffers), total, weights or LUMINANCE)
