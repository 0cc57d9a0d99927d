"""EuRoC's csv has its header, the scalar first and every digit."""

import numpy as np
import pytest

from tests.trajectory.random_poses import random_trajectory
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.euroc import csv_rows, format_euroc


def test_euroc_text_has_its_header_the_scalar_first_and_is_read_back():
    before = random_trajectory(50, seed=2)
    text = format_euroc(before)
    header = text.partition("\n")[0]
    parsed = parse_any(text, name="x")

    assert header.startswith("#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x []")
    assert header.count(",") == 7
    assert (parsed.unit, parsed.order) == ("ns", "wxyz")
    np.testing.assert_array_equal(parsed.t_ns, before.t_ns)
    np.testing.assert_allclose(parsed.T, before.T_world_frame, rtol=0, atol=1.5e-15)


@pytest.mark.parametrize(("columns", "last"), [(3, "v_RS_R_z [m s^-1]"), (9, "b_a_RS_S_z [m s^-2]")])
def test_euroc_text_may_have_velocities_and_biases(columns, last):
    before = random_trajectory(3, seed=2)
    more = np.arange(3.0 * columns).reshape(3, columns)
    header, *rows = format_euroc(before, more).splitlines()

    assert header.endswith(last)
    assert [[float(field) for field in row.split(",")[8:]] for row in rows] == more.tolist()


def test_rows_of_a_csv_have_a_stamp_and_every_digit():
    assert csv_rows(np.array([7, -8]), np.array([[0.1, 2.0], [1e-300, -0.0]])) == "7,0.1,2.0\n-8,1e-300,-0.0\n"
