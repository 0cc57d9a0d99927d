"""All that pictures of one size are drawn on."""

from dataclasses import dataclass

from vobench.render.framebuffer import Canvas, Grid, Sum, canvas, summed
from vobench.render.haze import Haze, haze
from vobench.render.mirror import Box

MIRRORS = 3  # followed, each seen in the one before


@dataclass(frozen=True, slots=True)
class Paper:
    """The picture's canvas, one for each mirror behind a mirror, what rough ones need, and the total of sub-frames."""

    canvases: tuple[Canvas, ...]
    haze: Haze
    total: Sum

    @property
    def canvas(self) -> Canvas:
        """What the picture itself is drawn on."""
        return self.canvases[0]

    @property
    def whole(self) -> Box:
        """The box of the whole picture."""
        return 0, self.canvas.width_px, 0, self.canvas.height_px

    def delete(self) -> None:
        """Free it on the graphics side."""
        for sheet in self.canvases:
            sheet.delete()
        self.haze.delete()
        self.total.delete()


def paper(width_px: int, height_px: int, grid: Grid) -> Paper:
    """Paper for pictures of some size and grid of samples."""
    size = width_px, height_px
    canvases = tuple(canvas(*size, grid) for _ in range(1 + MIRRORS))
    return Paper(canvases, haze(*size), summed(*size))
