"""The free space of a place is read as it was written, and only for the same place and the same code."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.motion.wander import Clearance
from vobench.suite import clearance_file
from vobench.suite.clearance_file import FOLDER, read_clearance, write_clearance

LEVEL = Clearance(-1.5, 2.25, 0.125, 0.1, np.random.default_rng(1).uniform(0, 2, (12, 9)))
UNEVEN = replace(LEVEL, ground_m=np.random.default_rng(2).uniform(-1, 1, (12, 9)))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty cache folder."""
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path))
    return tmp_path / FOLDER


@pytest.mark.parametrize("clearance", [LEVEL, UNEVEN])
def test_what_is_written_is_read_again_to_the_last_bit(clearance):
    write_clearance("flat.1", clearance)
    found = read_clearance("flat.1")
    assert (found.x_m, found.y_m, found.floor_m, found.cell_m) == (-1.5, 2.25, 0.125, 0.1)
    np.testing.assert_array_equal(found.distance_m, clearance.distance_m)
    if clearance.ground_m is None:
        assert found.ground_m is None
    else:
        np.testing.assert_array_equal(found.ground_m, clearance.ground_m)


def test_another_place_and_other_code_have_none(monkeypatch):
    write_clearance("flat.1", LEVEL)
    assert read_clearance("flat.2") is None
    monkeypatch.setattr(clearance_file, "_code", lambda: "other code")
    assert read_clearance("flat.1") is None


def test_a_damaged_file_counts_as_none_and_is_replaced(folder):
    write_clearance("flat.1", LEVEL)
    (file,) = folder.iterdir()
    for damaged in (b"", file.read_bytes()[:-200], b"PK" + bytes(50)):
        file.write_bytes(damaged)
        assert read_clearance("flat.1") is None
    write_clearance("flat.1", LEVEL)
    assert read_clearance("flat.1") is not None
    assert list(folder.iterdir()) == [file]


def test_nothing_is_kept_where_nothing_can_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "file"))
    write_clearance("flat.1", LEVEL)
    assert read_clearance("flat.1") is None
