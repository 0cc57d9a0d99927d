"""The style that all figures share: fonts, colours, sizes for papers, and files that hold no date."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from vobench.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

Abscissa = Literal["time", "path"]  # what errors are drawn over
ABSCISSAS: tuple[Abscissa, ...] = get_args(Abscissa)
ENDINGS = (".svg", ".png", ".pdf")
DPI = 110  # of figures for the screen
PAPER_DPI = 300
# Equal data give equal files: ids depend on content only. Type 42 embeds fonts as publishers ask for.
SETTINGS: Any = {
    "svg.hashsalt": "vobench",
    "pdf.fonttype": 42,
    "font.size": 8,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.axisbelow": True,
    "legend.fontsize": 7,
    "legend.framealpha": 0.8,
}
# Okabe and Ito (2008): colours that colour-blind readers can distinguish. Their black is used for the ground truth.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442")
LINES = ("-", "--", "-.", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
NEUTRAL = "#7f7f7f"
LINE_WIDTH = 1.2  # points
SHORT_RANGE = 100  # ratio of the ends of a logarithmic axis below which 2 and 5 are labelled, too
VERY_SHORT_RANGE = 5  # ratio below which a range may have fewer than two of the numbers 1, 2 and 5
MOST_INTERVALS = 4  # between evenly spaced ticks
COLUMN_INCHES = 3.5  # the width of a column of a paper with two columns, by the templates of IEEE
PAGE_INCHES = 7.16  # the width of both columns


def line_style(index: int) -> dict[str, Any]:
    """The colour and line style of the estimator with an index; the line style changes once all colours are used."""
    colour = COLOURS[index % len(COLOURS)]
    line = LINES[index // len(COLOURS) % len(LINES)]
    return {"color": colour, "ls": line}


def marker_style(index: int) -> dict[str, Any]:
    """The colour and marker of the estimator with an index."""
    colour = COLOURS[index % len(COLOURS)]
    marker = MARKERS[(index + index // len(COLOURS)) % len(MARKERS)]
    return {"color": colour, "marker": marker}


def label_plainly(axis: "Axis") -> None:
    """Label the ticks of a logarithmic axis with plain numbers: 1, 2 and 5 times powers of ten over a short range.

    A range that has few of these has evenly spaced ticks.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator

    low, high = axis.get_view_interval()
    if high < VERY_SHORT_RANGE * low:
        axis.set_major_locator(MaxNLocator(MOST_INTERVALS))
        axis.set_minor_locator(NullLocator())
    else:
        is_short = high < SHORT_RANGE * low
        axis.set_major_locator(LogLocator(base=10, subs=(1, 2, 5) if is_short else (1,)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def check_ending(path: Path) -> None:
    """Raise InputError unless the path ends like an SVG, PNG or PDF file."""
    if path.suffix not in ENDINGS:
        raise InputError(f"the name of a plot should end in {', '.join(ENDINGS)}, got {path}")


def undated(suffix: str) -> dict[str, None]:
    """The metadata that keeps dates out of a plot with this suffix."""
    return {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(suffix, {})


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as SVG, PNG or PDF by the ending of the path; equal figures give equal files.

    Raises InputError for another ending, or if the file cannot be written.
    """
    check_ending(path)
    import matplotlib as mpl

    with mpl.rc_context(SETTINGS):
        try:
            figure.savefig(path, dpi=PAPER_DPI, metadata=undated(path.suffix))
        except OSError as error:
            raise InputError(f"cannot write {path}: {error.strerror}") from None
