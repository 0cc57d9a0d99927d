"""All that pictures of one size are drawn on."""

from dataclasses import dataclass

from vobench.render.framebuffer import Canvas, Grid, Sum, canvas, summed
from vobench.render.haze import Haze, haze
from vobench.render.mirror import Box


@dataclass(frozen=True, slots=True)
class Paper:
    """The picture's canvas, two that mirrors are worked out on, and the total of all sub-frames."""

    canvas: Canvas
    reflections: Canvas
    haze: Haze
    total: Sum

    @property
    def whole(self) -> Box:
        """The box of the whole picture."""
        return 0, self.canvas.width_px, 0, self.canvas.height_px

    def delete(self) -> None:
        """Free it on the graphics side."""
        for sheet in (self.canvas, self.reflections, self.haze, self.total):
            sheet.delete()


def paper(width_px: int, height_px: int, grid: Grid) -> Paper:
    """Paper for pictures of some size and grid of samples."""
    size = width_px, height_px
    return Paper(canvas(*size, grid), canvas(*size, grid), haze(*size), summed(*size))
