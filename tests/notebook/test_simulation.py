"""A case is simulated from Python, once, and its pictures and truth are at hand."""

import numpy as np
import pytest

import vobench
from vobench.errors import InputError, UnknownNameError


def test_a_case_of_a_suite_is_simulated_once(here):
    first = vobench.simulate("tiny", case_name="short", quiet=True)
    made = (first.path / "sensors.mcap").stat().st_mtime_ns
    again = vobench.simulate(vobench.check("tiny").plan.cases[0], quiet=True)
    assert again.path == first.path
    assert (again.path / "sensors.mcap").stat().st_mtime_ns == made


def test_pictures_and_truth_go_together(here):
    simulation = vobench.simulate("tiny", quiet=True)
    sequence = simulation.sequence
    assert len(sequence) == len(simulation.ground_truth)
    assert sequence[0].left.shape == sequence[-1].right.shape
    assert [frame.t_ns for frame in sequence] == simulation.ground_truth.t_ns.tolist()
    np.testing.assert_array_equal(sequence[-1].left, sequence[len(sequence) - 1].left)
    with pytest.raises(IndexError, match=f"frame {len(sequence)} of a sequence with {len(sequence)} frames"):
        _ = sequence[len(sequence)]


def test_a_case_that_is_not_there_is_named(here):
    with pytest.raises(UnknownNameError, match=r"no case named 'shirt'. Did you mean 'short'"):
        vobench.simulate("tiny", case_name="shirt")
    with pytest.raises(InputError, match="leave them out for a case object"):
        vobench.simulate(vobench.check("tiny").plan.cases[0], case_name="short")
