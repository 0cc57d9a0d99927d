"""A figure of the paths and position errors of several estimators on one case, for the notebook."""

from matplotlib.figure import Figure

from vobench.report.error_figure import draw_position_errors
from vobench.report.inline_figure import new_figure
from vobench.report.path_figure import draw_paths
from vobench.report.scored_case import ScoredCase

WIDTH_INCHES = 9.0
HEIGHT_INCHES = 3.6
PLOT_WIDTHS = (1, 1.25)  # relative widths of the paths, which are about square, and of the errors over time
TITLE_X = 0.01  # the title's left edge, as a share of the figure's width


def plot_case(case: ScoredCase) -> Figure:
    """Plot the ground truth and the aligned estimates from above, and the position errors over time.

    An estimate that cannot be scored appears only in the legend.
    """
    with new_figure(WIDTH_INCHES, HEIGHT_INCHES) as figure:
        path_axes, error_axes = figure.subplots(1, 2, width_ratios=PLOT_WIDTHS)
        figure.suptitle(case.name, fontweight="bold", x=TITLE_X, ha="left")
        draw_paths(path_axes, case)
        path_axes.legend(loc="best")
        draw_position_errors(error_axes, case)
    return figure
