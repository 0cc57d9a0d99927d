"""A trial as a strip of pictures: which frames are shown, and how those without a pose are marked."""

from pathlib import Path

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.report import strip_figure as module
from vobench.report.figure_style import line_style
from vobench.report.strip_figure import _lost_spans, shown_frames, strip_figure
from vobench.runner.folder import SEQUENCE
from vobench.runner.frames import FrameRow


def rows_of(errors_m, lost=()):
    """The frames of a trial at 10 Hz with these position errors; None for no pose."""
    rows = []
    for frame, error_m in enumerate(errors_m):
        status = "lost" if frame in lost else "ok"
        known = dict.fromkeys(("tracks", "inliers", "exposure_s", "gain_db", "wall_ms", "cpu_ms"))
        rows.append(FrameRow(frame, frame * 100_000_000, status, "", error_m, error_m, stats="{}", **known))
    return rows


def test_the_first_the_last_and_the_worst_frames_are_shown_and_others_fill_the_gaps():
    errors_m = [0.0] * 40
    errors_m[30] = 0.5
    assert shown_frames(rows_of(errors_m), 4) == [0, 15, 30, 39]
    assert 12 in shown_frames(rows_of(errors_m, lost=(12,)), 4)


def test_a_short_trial_shows_all_of_its_frames():
    assert shown_frames(rows_of([0.0, 0.1, 0.2]), 5) == [0, 1, 2]
    assert shown_frames(rows_of([0.0]), 5) == [0]


class FakeRecording:
    """Pictures of 8 × 6 pixels."""

    @classmethod
    def open(cls, _):
        return cls()

    def frame(self, _):
        return type("Frame", (), {"left": np.full((6, 8), 90, np.uint8)})()


@pytest.fixture
def drawn(scored, write_run, tmp_path, monkeypatch):
    """Draws a trial of 20 frames, in which frames 5 to 7 are lost."""
    trial = scored("a", "lost")
    folder = write_run(tmp_path / "run", [trial])
    (folder.case("down") / SEQUENCE).mkdir()
    errors_m = [None if frame in (5, 6, 7) else 0.001 * frame for frame in range(20)]
    rows = rows_of(errors_m, lost=(5, 6, 7))
    tracks = {5: np.array([[0, 0, 1, 2, 1], [0, 0, 3, 4, 0], [0, 0, 5, 5, 0]], np.float32)}
    monkeypatch.setattr(module, "read_frames", lambda _: rows)
    monkeypatch.setattr(module, "read_tracks", lambda _: iter(tracks.items()))
    monkeypatch.setattr(module, "Recording", FakeRecording)
    return strip_figure(folder, trial, 3, 6.0)


def test_the_error_has_the_colour_of_the_estimator(drawn):
    assert drawn.axes[-1].get_lines()[0].get_color() == line_style(3)["color"]


def test_lost_frames_are_named_framed_and_shaded(drawn):
    *pictures, errors = drawn.axes
    titles = [axes.get_title() for axes in pictures]
    assert titles[0] == "frame 0"
    assert "frame 5, lost" in titles
    (shade,) = errors.patches
    assert (shade.get_x(), shade.get_x() + shade.get_width()) == pytest.approx((0.45, 0.75))
    assert "a on down: lost" in drawn.get_suptitle()


def test_tracks_are_drawn_where_they_are_in_two_colours(drawn):
    axes = next(axes for axes in drawn.axes if axes.get_title() == "frame 5, lost")
    inliers, outliers = axes.collections
    assert inliers.get_offsets().tolist() == [[1, 2]]
    assert outliers.get_offsets().tolist() == [[3, 4], [5, 5]]
    assert inliers.get_facecolor().tolist() != outliers.get_facecolor().tolist()


def test_errors_are_in_mm_over_seconds(drawn):
    errors = drawn.axes[-1]
    line = errors.get_lines()[0]
    assert line.get_xdata()[-1] == pytest.approx(1.9)
    assert line.get_ydata()[-1] == pytest.approx(19.0)
    assert np.isnan(line.get_ydata()[5:8]).all()


def test_a_run_whose_pictures_are_gone_says_how_to_make_them_again(scored, write_run, tmp_path):
    folder = write_run(Path(tmp_path / "run"), [scored("a")])
    with pytest.raises(InputError, match="run the suite again to recreate it"):
        strip_figure(folder, scored("a"), 0, 6.0)


@pytest.mark.parametrize(
    ("lost", "spans"),
    [
        ([1, 1, 1, 1], [(0.0, 4.0)]),
        ([0, 1, 0, 1], [(0.5, 1.5), (3.0, 4.0)]),
        ([1, 0, 0, 0], [(0.0, 0.5)]),
        ([0, 0, 0, 0], []),
    ],
)
def test_a_lost_span_ends_halfway_to_its_neighbours_and_at_the_ends_of_the_trial(lost, spans):
    assert _lost_spans(np.array([0.0, 1.0, 2.0, 4.0]), np.array(lost, bool)) == spans
