"""The figure of segment errors per length of the KITTI odometry benchmark, as box plots of several estimators."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.metric.score import Samples, Score
from vobench.report.board_metric import PERCENT
from vobench.report.error_figure import scale_errors_axis
from vobench.report.figure_style import COLOURS, line_style
from vobench.report.inline_figure import new_figure
from vobench.report.path_figure import LEGEND_INCHES
from vobench.report.scored_case import ScoredCase

TRANSLATION = "kitti_t_rel"
ROTATION = "kitti_r_rel"
ROW_HEIGHT = 0.45  # of one of the two rows, relative to the width of the figure
BOXES_WIDTH = 0.8  # of the boxes of one length together; the distance between lengths is 1
WHISKERS_PERCENT = (5, 95)
BOX_ALPHA = 0.55


@dataclass(frozen=True, slots=True)
class SegmentSamples:
    """The errors (N,) of all segments of an estimator, and their nominal lengths (N,) in m."""

    estimator: str
    index: int
    length_m: Array
    errors: Array


def segment_figure(cases: Sequence[ScoredCase], width_inches: float) -> Figure:
    """The translation and rotation errors of segments by length: boxes are quartiles, whiskers 5 % to 95 %.

    Segments of all cases are pooled. Raises InputError if no path is as long as a segment.
    """
    translation = _pooled_samples(cases, TRANSLATION, PERCENT)
    rotation = _pooled_samples(cases, ROTATION, 1.0)
    if not translation:
        raise InputError("no estimate has a segment: the paths are too short, or no pose was estimated")
    with new_figure(width_inches, 2 * ROW_HEIGHT * width_inches + LEGEND_INCHES) as figure:
        translation_axes, rotation_axes = figure.subplots(2, 1, sharex=True)
        _draw_boxes(translation_axes, translation)
        _draw_boxes(rotation_axes, rotation)
        translation_axes.set_ylabel("translation error (%)")
        rotation_axes.set_ylabel("rotation error (°/m)")
        rotation_axes.set_xlabel("segment length (m)")
        figure.suptitle(_title(cases))
        figure.legend(handles=_legend_patches(translation), loc="outside lower center", ncols=2)
    return figure


def _title(cases: Sequence[ScoredCase]) -> str:
    return cases[0].name if len(cases) == 1 else f"{len(cases)} cases"


def _pooled_samples(cases: Sequence[ScoredCase], metric: str, scale: float) -> list[SegmentSamples]:
    """The samples of each estimator over all cases, in the order of their indices; those without any are omitted."""
    samples_by_estimator: dict[tuple[int, str], list[Samples]] = {}
    for case in cases:
        for estimate, score in case.scores:
            samples = _samples(score, metric)
            if samples is not None:
                key = estimate.index, estimate.estimator
                samples_by_estimator.setdefault(key, []).append(samples)

    pooled = []
    for (index, estimator), parts in sorted(samples_by_estimator.items()):
        lengths_m = [part.over.length_m for part in parts if part.over is not None]
        errors = [scale * part.errors for part in parts]
        pooled.append(SegmentSamples(estimator, index, np.concatenate(lengths_m), np.concatenate(errors)))
    return pooled


def _samples(score: Score, metric: str) -> Samples | None:
    """The samples of a metric of segments; None if the score has none."""
    for samples in score.samples:
        if samples.of.id == metric and samples.over is not None:
            return samples
    return None


def _draw_boxes(axes: Axes, estimators: Sequence[SegmentSamples]) -> None:
    """Draw a box for each length and estimator; those of one length stand side by side."""
    lengths_m = np.unique(np.concatenate([samples.length_m for samples in estimators]))
    width = BOXES_WIDTH / len(estimators)
    for place, samples in enumerate(estimators):
        offset = (place - (len(estimators) - 1) / 2) * width
        has_length = np.isin(lengths_m, samples.length_m)
        errors = [samples.errors[samples.length_m == length_m] for length_m in lengths_m[has_length]]
        colour = line_style(samples.index)["color"]
        axes.boxplot(
            errors,
            positions=np.flatnonzero(has_length) + offset,
            widths=0.85 * width,
            whis=WHISKERS_PERCENT,
            showfliers=False,
            patch_artist=True,
            manage_ticks=False,
            medianprops={"color": "black"},
            boxprops={"facecolor": colour, "alpha": BOX_ALPHA, "linewidth": 0.6},
            whiskerprops={"color": colour},
            capprops={"color": colour},
        )
    axes.set_xticks(np.arange(len(lengths_m)), [f"{length_m:g}" for length_m in lengths_m])
    axes.set_xlim(-0.6, len(lengths_m) - 0.4)
    scale_errors_axis(axes, [samples.errors for samples in estimators])


def _legend_patches(estimators: Sequence[SegmentSamples]) -> list[Patch]:
    patches = []
    for samples in estimators:
        colour = COLOURS[samples.index % len(COLOURS)]
        patches.append(Patch(facecolor=colour, alpha=BOX_ALPHA, edgecolor="black", label=samples.estimator))
    return patches
