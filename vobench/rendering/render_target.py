"""The targets that pictures are drawn on: a canvas for each depth of mirrors, and the sum of sub-frames."""

from dataclasses import dataclass

from vobench.rendering.opengl import Canvas, FlatTarget, Grid, canvas, flat_target
from vobench.rendering.uniform_block import MIRROR_PLANES
from vobench.scene.material import LUMINANCE, Rgb

MIRRORS = MIRROR_PLANES  # followed, each seen in the one before


@dataclass(frozen=True, slots=True)
class RenderTarget:
    """The canvas of a picture and one for each mirror seen in a mirror; the total of sub-frames.

    weights (3,) of linear red, green and blue where the total has one channel.
    """

    canvases: tuple[Canvas, ...]
    total: FlatTarget
    weights: Rgb

    @property
    def canvas(self) -> Canvas:
        """The canvas of the picture itself."""
        return self.canvases[0]


def render_target(
    width_px: int,
    height_px: int,
    grid: Grid,
    weights: Rgb | None,
    *,
    in_colour: bool,
) -> RenderTarget:
    """A target for pictures of a size and grid of samples, with one channel or, without weights, three.

    in_colour: whether samples have three channels in either case, as where mirrors are tinted.
    """
    channels = 3 if weights is None else 1
    sample_channels = 3 if in_colour else channels
    canvases = tuple(canvas(width_px, height_px, grid, sample_channels) for _ in range(1 + MIRRORS))
    total = flat_target(width_px, height_px, channels)
    return RenderTarget(canvases, total, weights or LUMINANCE)
