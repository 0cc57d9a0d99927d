"""The content of a sequence that is exported."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vobench.dataset.source import open_source
from vobench.errors import SequenceError
from vobench.geometry.rig import Rig
from vobench.sequence.topic import TRUTH_FILE

Make = Callable[..., Any]


def test_a_source_has_what_was_recorded_and_none_for_the_rest(make_sequence: Make, rig_of: Callable[..., Rig]) -> None:
    made = make_sequence(rig_of(imu=True), depth=True)
    source = open_source(made.folder)
    assert source.channels == ("depth",)
    assert source.case == {"seed": 7}
    assert source.imu is not None
    assert source.rig.imu is not None
    assert replace(source, imu=None).rig.imu is None
    np.testing.assert_array_equal(source.twist, made.twist)
    plain = open_source(make_sequence(with_twist=False, case_json=b"[]").folder)
    assert plain.imu is None
    assert plain.bias is None
    assert plain.twist is None
    assert plain.case is None


def test_a_case_whose_bytes_changed_on_the_disk_is_refused_and_not_taken_for_none(make_sequence: Make) -> None:
    made = make_sequence(case_json=b'{"seed": 123456789}')
    path = made.folder / TRUTH_FILE
    data = path.read_bytes()
    assert data.count(b"123456789") == 1
    path.write_bytes(data.replace(b"123456789", b"123456780"))
    with pytest.raises(SequenceError, match=r"checksum of the attachment 'case\.json' differs from its content"):
        open_source(made.folder)


@pytest.mark.parametrize("case_json", [b'{"seed": ', b"", b'{"\xff": 7}'])
def test_a_damaged_case_is_refused_with_its_file(make_sequence: Make, case_json: bytes) -> None:
    made = make_sequence(case_json=case_json)
    with pytest.raises(SequenceError, match=r"case\.json is not JSON \(.*\): .*truth\.mcap$"):
        open_source(made.folder)
