"""Sequences are opened from Python."""

import pytest

import vobench
from vobench.errors import SequenceError


def test_a_sequence_is_that_of_its_simulation(here):
    simulation = vobench.simulate("tiny", quiet=True)
    opened = vobench.read_sequence(str(simulation.path))
    assert [frame.t_ns for frame in opened] == [frame.t_ns for frame in simulation.sequence]


def test_a_folder_without_a_sequence_is_refused(tmp_path):
    with pytest.raises(SequenceError):
        vobench.read_sequence(tmp_path)
