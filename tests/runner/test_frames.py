"""The table of a trial's frames: joined by frame and stamp, and read back as it was written."""

from types import SimpleNamespace

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.runner.frames import (
    ANSWER_COLUMNS,
    ANSWERS,
    COLUMNS,
    COST_COLUMNS,
    EXPOSURE_COLUMNS,
    EXPOSURES,
    FRAME_FIELDS,
    FRAMES,
    TIME_COLUMNS,
    TIMES,
    FrameRow,
    new_table,
    read_frames,
    read_table,
    write_frames,
)


def write(path, columns, *rows):
    with new_table(path, columns) as table:
        for row in rows:
            table.writerow(dict(zip(columns, row, strict=True)))


@pytest.fixture
def trial(tmp_path):
    """Three frames: one that was answered and has an error, one that was answered, and one that was not."""
    write(tmp_path / EXPOSURES, EXPOSURE_COLUMNS, (0, 100, 0.01, 6.0), (1, 200, "", ""), (2, 300, 0.02, 0.0))
    write(tmp_path / ANSWERS, ANSWER_COLUMNS, (0, "ok", "", 40, 38, '{"a": 1}'), (1, "lost", "dark", "", "", "{}"))
    write(tmp_path / TIMES, TIME_COLUMNS, (0, 1.5, 1.25, 80.0), (1, 2.5, 2.25, 81.0))
    scored = SimpleNamespace(
        gt_t_ns=np.array([100, 300]), ate_trans_m=np.array([0.25, 0.5]), ate_rot_deg=np.array([1.0, 2.0])
    )
    write_frames(tmp_path, tmp_path, scored, tmp_path)
    return tmp_path


def test_a_row_has_the_answer_the_error_the_exposure_and_the_cost_of_its_frame(trial):
    answered, lost, silent = read_frames(trial)
    assert answered == FrameRow(0, 100, "ok", "", 0.25, 1.0, 40, 38, 0.01, 6.0, '{"a": 1}', 1.5, 1.25, 80.0)
    assert lost == FrameRow(1, 200, "lost", "dark", None, None, None, None, None, None, "{}", 2.5, 2.25, 81.0)
    assert silent == FrameRow(2, 300, "", "", 0.5, 2.0, None, None, 0.02, 0.0, "", None, None, None)


def test_without_a_score_no_frame_has_an_error(trial):
    write_frames(trial, trial, None, trial)
    assert {row.position_error_m for row in read_frames(trial)} == {None}


def test_times_stand_in_a_table_of_their_own():
    assert set(COLUMNS) | set(COST_COLUMNS) == set(FRAME_FIELDS)
    assert set(COLUMNS).isdisjoint(COST_COLUMNS)


def test_a_table_is_read_as_it_was_written(tmp_path):
    write(tmp_path / "a.csv", ("x", "y"), (1, "a, b"), ("", 'say "c"'))
    assert read_table(tmp_path / "a.csv") == [{"x": "1", "y": "a, b"}, {"x": "", "y": 'say "c"'}]
    assert (tmp_path / "a.csv").read_bytes().startswith(b"x,y\n1,")


def test_a_run_without_times_is_one_of_an_older_vobench(trial):
    (trial / TIMES).unlink()
    with pytest.raises(InputError, match="a run of an older vobench, without a table of times"):
        read_frames(trial)


def test_a_cell_that_is_no_number_is_named(trial):
    text = (trial / FRAMES).read_text()
    (trial / FRAMES).write_text(text.replace("0.25", "near"))
    with pytest.raises(InputError, match=r"not a table of frames as vobench writes it \(0\.position_error_m: "):
        read_frames(trial)
