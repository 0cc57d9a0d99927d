"""The recording of a run's case is its sequence."""

import shutil

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.runner.folder import SEQUENCE
from vobench.runner.recording import read_recording, sequence_path


def test_a_case_and_its_sequence_are_the_same_recording(first):
    case = first.case("dim")
    by_case, by_sequence = read_recording(case), read_recording(case / SEQUENCE)
    assert by_case.form == by_sequence.form == "vobench"
    np.testing.assert_array_equal(by_case.t_ns, by_sequence.t_ns)


def test_any_other_path_is_itself(tmp_path):
    assert sequence_path(tmp_path) == tmp_path


def test_a_case_whose_sequence_is_gone_from_the_cache_is_a_sentence(first, tmp_path):
    shutil.copytree(first.case("dim"), tmp_path / "dim", symlinks=True)
    link = tmp_path / "dim" / SEQUENCE
    link.unlink()
    link.symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="not in the cache any more; run the suite again"):
        read_recording(tmp_path / "dim")
