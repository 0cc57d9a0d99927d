"""The smallest case that still fails."""

import pytest

from vobench.analysis.nuisance import nuisances_of
from vobench.analysis.shrink import Failure, shrink
from vobench.suite.suite import Case


@pytest.mark.parametrize("wrong_at", [0, 3, 150, 299])
def test_a_failure_within_few_frames_is_found_within_twelve_trials(hard: Case, wrong_at: int) -> None:
    needed, likely = (max(0, wrong_at - 4), min(300, wrong_at + 5)), lambda window: window[0] <= wrong_at < window[1]
    ran: list[Case] = []

    def fails(case: Case) -> bool:
        ran.append(case)
        assert case.frames is not None
        return case.frames[0] <= needed[0] and case.frames[1] >= needed[1]

    found = shrink(hard, (0, 300), likely, nuisances_of(hard), fails, trials=12)
    assert fails(found.case)
    assert found.case.frames is not None
    assert found.case.frames[1] - found.case.frames[0] <= 60
    assert len(ran) - 1 == len(found.tried) <= 12
    assert found.removed


def test_nuisances_that_it_fails_without_go_and_the_one_that_it_fails_for_stays(hard: Case) -> None:
    def fails(case: Case) -> bool:
        return case.rig.calibration_error == hard.rig.calibration_error

    found = shrink(hard, (0, 40), lambda _: True, nuisances_of(hard), fails, trials=40)
    left = {nuisance.name for nuisance in nuisances_of(found.case)} - {"burnt pixels"}
    assert left == {"calibration"}


def test_what_fails_as_a_whole_alone_stays_whole(hard: Case) -> None:
    found = shrink(hard, (0, 100), lambda _: True, (), lambda case: case.frames in (None, (0, 100)), trials=12)
    assert found.case.frames in (None, (0, 100))
    assert len(found.tried) <= 12


def test_reasons_are_alike_whatever_their_numbers() -> None:
    assert Failure.of("lost", "a pose for 43% of the frames") == Failure.of("lost", "a pose for 7% of the frames")
    assert Failure.of("diverged", "ATE 1.2e+03 m on 3 m") == Failure.of("diverged", "ATE 7 m on 0.3 m")
    assert Failure.of("lost", "x") != Failure.of("crashed", "x")
