"""The estimators of a twin are named by label, glob, name or as an entry of a suite."""

import pytest

from vobench.analysis.twin_estimators import USUAL_ESTIMATORS, twin_estimators
from vobench.errors import InputError, SuiteError, UnknownNameError

PLAIN = {"name": "lk_epipolar", "label": "lk_epipolar_plain", "params": {"estimate_offset": 0}}
WIDE = {"name": "stereo_pnp", "label": "wide", "params": {"window_px": 31}}


def test_without_names_the_usual_ones_run() -> None:
    assert twin_estimators() == list(USUAL_ESTIMATORS)


def test_labels_globs_names_and_entries_may_be_mixed() -> None:
    entry = "{name: stereo_pnp, label: wide, params: {window_px: 31}}"
    assert twin_estimators(["lk_epipolar_plain", "wheel_odometry", entry]) == [PLAIN, "wheel_odometry", WIDE]
    assert twin_estimators(["lk_*", entry]) == ["lk_epipolar", PLAIN, WIDE]


@pytest.mark.parametrize(
    ("entry", "error", "sentence"),
    [
        ("nothing", UnknownNameError, "no estimator named 'nothing'"),
        ("{name: stereo_pnp, params: {windw_px: 21}}", SuiteError, "no parameter named 'windw_px'"),
        ("{name: stereo_pnp, parms: {}}", SuiteError, "parms"),
        ("{name: stereo_pnp", SuiteError, "-e"),
        ("lk_epipolar", SuiteError, "two estimators are called 'lk_epipolar'"),
    ],
)
def test_a_wrong_entry_is_a_sentence(entry: str, error: type[Exception], sentence: str) -> None:
    with pytest.raises((error, SuiteError), match=sentence):
        twin_estimators(["lk_epipolar", "mono_vo", entry])


def test_two_are_no_order() -> None:
    with pytest.raises(InputError, match="3 estimators or more, and -e names 2"):
        twin_estimators(["a", "b"])
