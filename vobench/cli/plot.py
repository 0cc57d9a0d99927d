"""vobench plot."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from vobench.cli import terminal
from vobench.cli.option import Json, option_group, with_option_groups
from vobench.cli.trajectory_option import TrajectoryOptions
from vobench.errors import InputError, require_known
from vobench.report.figure_style import ABSCISSAS, COLUMN_INCHES, ENDINGS, PAGE_INCHES, Abscissa, save_figure

if TYPE_CHECKING:
    from vobench.report.figure_kind import FigureOptions, FileFigures, RunFigures

WIDTHS_INCHES = {"column": COLUMN_INCHES, "page": PAGE_INCHES}
MAX_WIDTH_INCHES = 40.0


@option_group
class FigureSelection:
    """Options that select the kinds of figures, and the cases and estimators that they show."""

    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            "-k",
            help="path, axes, error, segments, cumulative, and of a run breakdown, cost, matrix, strip; can be "
            "repeated. All by default.",
        ),
    ] = None
    case: Annotated[
        list[str] | None,
        typer.Option("--case", "-c", help="A case of the run, or a pattern; can be repeated. All by default."),
    ] = None
    estimator: Annotated[
        list[str] | None,
        typer.Option("--estimator", "-e", help="An estimator, or a pattern; can be repeated. All by default."),
    ] = None


@option_group
class FigureForm:
    """Options that specify the axes, the metric and the width of figures."""

    over: Annotated[str, typer.Option(help="What errors are drawn over: time or path.")] = "time"
    metric: Annotated[str, typer.Option(help="The metric of the matrix, as of `vobench report`.")] = "ate"
    width: Annotated[
        str | None,
        typer.Option(
            help="The width: column or page of a paper with two columns, or a number of inches; by default column, or "
            "page for breakdown and strip."
        ),
    ] = None

    @property
    def width_inches(self) -> float | None:
        """The width of all figures; None for the default width of each kind. Raises InputError if it is invalid."""
        return None if self.width is None else _width_inches(self.width)

    def options(self) -> "FigureOptions":
        """The options of figures.

        Raises UnknownNameError for an unknown axis or metric, and InputError for an invalid width.
        """
        from vobench.report.board_metric import METRICS
        from vobench.report.figure_kind import FigureOptions

        over = cast("Abscissa", require_known("abscissa", self.over, ABSCISSAS))
        require_known("metric", self.metric, METRICS)
        return FigureOptions(width_inches=self.width_inches, over=over, metric=self.metric)


def _width_inches(text: str) -> float:
    """The width in inches, from the text of the option. Raises InputError if it is invalid."""
    if text in WIDTHS_INCHES:
        return WIDTHS_INCHES[text]
    try:
        width_inches = float(text)
    except ValueError:
        width_inches = 0.0
    if not 1.0 <= width_inches <= MAX_WIDTH_INCHES:
        raise InputError(f"--width should be column, page, or 1 to {MAX_WIDTH_INCHES:g} inches, got {text!r}")
    return width_inches


@with_option_groups
def plot_command(
    source: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN | GT EST...",
            help="The folder of a run or a bundle; or a file of ground truth and one or more estimates.",
        ),
    ],
    *,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="A .pdf, .svg or .png for one kind of figure, or a folder.")
    ] = Path("figures"),
    selection: FigureSelection,
    form: FigureForm,
    file_format: Annotated[str, typer.Option("--format", help="pdf, svg or png, for figures in a folder.")] = "pdf",
    align: Annotated[
        str, typer.Option("--align", "-a", help="The alignment of files: none, origin, se3, sim3, scale or yaw.")
    ] = "se3",
    trajectories: TrajectoryOptions,
    json: Json = False,
) -> None:
    """Draw figures of a run, or of files of trajectories, as PDF, SVG or PNG for papers and slides."""
    from vobench.runner.bundle import opened

    kinds = selection.kind or []
    endings = [ending.removeprefix(".") for ending in ENDINGS]
    require_known("format of figures", file_format, endings)
    is_one_file = out.suffix in ENDINGS
    if is_one_file and len(kinds) != 1:
        raise InputError(f"one file holds one figure; name its --kind, or a folder instead of {out}")

    options = form.options()
    if len(source) > 1:
        figures = _file_figures(source, selection, align, trajectories, options)
        written = _draw(figures, kinds, out, file_format)
    else:
        with opened(source[0], terminal.warn) as folder:
            from vobench.report.figure_kind import RunFigures

            run_figures = RunFigures(
                folder, cases=selection.case or (), estimators=selection.estimator or (), options=options
            )
            written = _draw(run_figures, kinds, out, file_format)
    if json:
        terminal.print_json({"files": [str(path) for path in written]})
        return
    for path in written:
        print(path)


def _file_figures(
    source: Sequence[Path],
    selection: FigureSelection,
    align: str,
    trajectories: TrajectoryOptions,
    options: "FigureOptions",
) -> "FileFigures":
    """The figures of files: the first file is the ground truth, and the others are estimates.

    Raises InputError if options for runs were given, or if a file cannot be read.
    """
    from vobench.report.figure_kind import FileFigures
    from vobench.report.scored_case import scored_files
    from vobench.runner.score_settings import settings_like

    if selection.case or selection.estimator:
        raise InputError("--case and --estimator choose from a run; of files, name those that are to be drawn")
    truth = trajectories.truth(source[0])
    estimates = [trajectories.estimate(path) for path in source[1:]]
    settings = settings_like(None, alignment=align)
    case = scored_files(truth, estimates, settings=settings, times=trajectories.time_files)
    return FileFigures(case, options)


def _draw(figures: "FileFigures | RunFigures", kinds: Sequence[str], out: Path, file_format: str) -> list[Path]:
    """Draw figures to a file or a folder, and return the paths.

    A kind for which there is nothing to draw is an error if it was asked for, and is left out otherwise.
    """
    if out.suffix in ENDINGS:
        figure = figures.draw(kinds[0])
        _make_folder(out.parent)
        save_figure(figure, out)
        return [out]

    written = []
    for kind in kinds or figures.kinds:
        path = out / f"{kind}.{file_format}"
        try:
            figure = figures.draw(kind)
        except InputError as error:
            if kinds:
                raise
            terminal.warn(f"no figure '{kind}': {error}")
            continue
        _make_folder(out)
        save_figure(figure, path)
        written.append(path)
    return written


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {folder}: {error.strerror}") from None
