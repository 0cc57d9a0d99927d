"""Notes on a cell in sentences: what its numbers do not show."""

from vobench.report.cell import Cell

LEAST_OFFSET_PX = 0.05  # smaller ones are within what estimators find on a pair without an error


def notes(cell: Cell) -> list[str]:
    """Sentences on failures, drift, dropped frames, revised poses, scale, covariances and frames of a cell."""
    sentences = (
        _failure(cell),
        _drift(cell),
        _dropped_frames(cell),
        _revised_estimate(cell),
        _scale_drift(cell),
        cell.consistency,
        disparity_offset_sentence(cell.answered.offset_px),
        _frame_reason(cell),
    )
    return [f"{cell.estimator}: {sentence}" for sentence in sentences if sentence]


def _failure(cell: Cell) -> str:
    return f"{cell.status}: {cell.reason}" if cell.reason else ""


def _drift(cell: Cell) -> str:
    if cell.drift_mm is None:
        return ""
    return f"drift of {cell.drift_mm:.1f} mm while the camera is stationary"


def _dropped_frames(cell: Cell) -> str:
    frames = cell.answered
    if not frames.dropped:
        return ""
    deadlines = "1 deadline" if frames.late == 1 else f"{frames.late} deadlines"
    return f"real time: {deadlines} missed, {frames.dropped} of {frames.frames} frames dropped"


def _revised_estimate(cell: Cell) -> str:
    if cell.revised_ate_mm is None:
        return ""
    segments = "–" if cell.revised_segment_percent is None else f"{cell.revised_segment_percent:.3f}"
    return f"revised estimate: ATE {cell.revised_ate_mm:.2f} mm, segments {segments} %"


def _scale_drift(cell: Cell) -> str:
    if cell.scale_drift_percent_per_m is None:
        return ""
    return f"aligned with scale, which drifts by {cell.scale_drift_percent_per_m:+.2g} % per metre"


def disparity_offset_sentence(offset_px: float | None) -> str:
    """The sentence on the offset of a stereo pair's disparities that an estimator found; empty if it found none."""
    if offset_px is None or abs(offset_px) < LEAST_OFFSET_PX:
        return ""
    return f"disparities of this stereo pair look off by {offset_px:+.2g} px: check its calibration"


def _frame_reason(cell: Cell) -> str:
    """The commonest reason that the estimator gave for single frames."""
    frames = cell.answered
    if not frames.reason:
        return ""
    count = "1 frame" if frames.count == 1 else f"{frames.count} frames"
    trials = f" in {cell.trials} trials" if cell.trials > 1 else ""
    return f'{count}{trials} with "{frames.reason}", first in frame {frames.first}'
