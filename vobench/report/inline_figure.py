"""A matplotlib figure that notebooks display, even if pyplot has not been imported."""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

import matplotlib as mpl
from matplotlib.figure import Figure

from vobench.report.figure_style import DPI, SETTINGS


class InlineFigure(Figure):
    """A figure that Jupyter displays as a picture."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        with mpl.rc_context(SETTINGS):
            self.savefig(buffer, format="png", dpi=DPI)
        return buffer.getvalue()


@contextmanager
def new_figure(width_inches: float, height_inches: float) -> Iterator[InlineFigure]:
    """An empty figure in vobench's style. What is drawn within the context has that style, too."""
    with mpl.rc_context(SETTINGS):
        yield InlineFigure(figsize=(width_inches, height_inches), layout="constrained")
