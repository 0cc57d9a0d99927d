"""Of equal stamps or frame numbers the first counts; a decrease is refused."""

import numpy as np
import pytest

from vobench.errors import TrajectoryError
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.increasing_column import distinct_rows, require_steps
from vobench.trajectory.text_table import TextTable

TUM = "1.5 1 2 3 0 0 0.6 0.8\n2.5 2 3 4 0 0 0 1\n"
EUROC = "#timestamp [ns],px,py,pz,qw,qx,qy,qz,vx\n1500000000,1,2,3,0.8,0,0,0.6,9\n"


def test_of_rows_that_repeat_a_stamp_the_first_counts_and_that_is_said():
    again = TUM + "2.500000000 9 9 9 0 0 0 1\n2.5 8 8 8 0 0 0 1\n3.5 3 4 5 0 0 0 1\n"
    parsed = parse_any(again, name="run.txt")
    assert parsed.t_ns.tolist() == [1_500_000_000, 2_500_000_000, 3_500_000_000]
    assert parsed.T[:, 0, 3].tolist() == [1.0, 2.0, 3.0]
    said = "rows that repeat the stamp of the row before were left out: 2 of 5, the first at run.txt:3"
    assert parsed.notes == (said,)
    assert parse_any(TUM, name="run.txt").notes == ()
    assert parse_any(EUROC + EUROC.splitlines()[1], name="run.txt").T.shape == (1, 4, 4)


def test_steps_may_be_no_smaller_than_demanded():
    table = TextTable("run.txt", [4, 6, 7], ["1", "2", "4"], np.empty((3, 0)))
    numbers = np.array([1, 2, 4])
    require_steps(table, numbers, least_step=1, demand="numbers must increase by 1")
    with pytest.raises(TrajectoryError, match=r"^run\.txt:6: numbers must increase by 2, but 2 follows 1$"):
        require_steps(table, numbers, least_step=2, demand="numbers must increase by 2")


def test_distinct_rows_are_the_first_of_their_number():
    table = TextTable("run.txt", [1, 2, 3, 5], ["7", "7", "8", "8"], np.empty((4, 0)))
    distinct = distinct_rows(table, np.array([7, 7, 8, 8]), "frame number")
    assert distinct.numbers.tolist() == [7, 8]
    assert distinct.rows.tolist() == [0, 2]
    assert distinct.notes == (
        "rows that repeat the frame number of the row before were left out: 2 of 4, the first at run.txt:2",
    )
