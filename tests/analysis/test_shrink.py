"""The smallest case that still fails."""

import pytest

from vobench.analysis.nuisance import nuisances_of
from vobench.analysis.shrink import Failure, middle_of_first_run, shrink
from vobench.suite.case import Case


@pytest.mark.parametrize("wrong_at", [0, 3, 150, 299])
def test_a_failure_within_few_frames_is_found_within_twelve_trials(hard: Case, wrong_at: int) -> None:
    needed, likely = (max(0, wrong_at - 4), min(300, wrong_at + 5)), lambda window: window[0] <= wrong_at < window[1]
    ran: list[Case] = []

    def fails(case: Case) -> bool:
        ran.append(case)
        assert case.frames is not None
        return case.frames[0] <= needed[0] and case.frames[1] >= needed[1]

    nuisances = [nuisance for nuisance in nuisances_of(hard) if not nuisance.is_circumstance]
    found = shrink(hard, (0, 300), is_likely=likely, nuisances=nuisances, fails=fails, trials=12)
    assert fails(found.case)
    assert found.case.frames is not None
    assert found.case.frames[1] - found.case.frames[0] <= 60
    assert len(ran) - 1 == len(found.tried) <= 12
    assert found.removed


def test_nuisances_that_it_fails_without_go_and_the_one_that_it_fails_for_stays(hard: Case) -> None:
    def fails(case: Case) -> bool:
        return case.rig.calibration_error == hard.rig.calibration_error

    nuisances = [nuisance for nuisance in nuisances_of(hard) if not nuisance.is_circumstance]
    found = shrink(hard, (0, 40), is_likely=lambda _: True, nuisances=nuisances, fails=fails, trials=40)
    assert set(found.removed) == {nuisance.name for nuisance in nuisances} - {"calibration"}


def test_what_fails_as_a_whole_alone_stays_whole(hard: Case) -> None:
    def fails(case: Case) -> bool:
        return case.frames in (None, (0, 100))

    found = shrink(hard, (0, 100), is_likely=lambda _: True, nuisances=(), fails=fails, trials=12)
    assert found.case.frames in (None, (0, 100))
    assert len(found.tried) <= 12


def test_reasons_are_alike_whatever_their_numbers() -> None:
    assert Failure.of("lost", "a pose for 43% of the frames") == Failure.of("lost", "a pose for 7% of the frames")
    assert Failure.of("diverged", "ATE 1.2e+03 m on 3 m") == Failure.of("diverged", "ATE 7 m on 0.3 m")
    assert Failure.of("lost", "x") != Failure.of("crashed", "x")


# --- The search, step by step ---


@pytest.mark.parametrize(
    ("is_set", "middle"),
    [
        ([], None),
        ([False, False], None),
        ([True], 0),
        ([False, True, True, True, False], 2),
        ([False, True, True, False, True, True, True, True, True], 2),
        ([True, True, True, True], 2),
    ],
)
def test_the_middle_of_the_first_run_is_found(is_set, middle) -> None:
    assert middle_of_first_run(is_set) == middle


def windows_tried(hard: Case, whole, fails, *, likely=lambda _: True, trials=50) -> list[tuple[int, int]]:
    ran = []

    def run(case: Case) -> bool:
        ran.append(case.frames)
        return fails(case.frames)

    shrink(hard, whole, is_likely=likely, nuisances=(), fails=run, trials=trials)
    return ran


def test_windows_are_looked_at_a_quarter_of_their_length_apart_up_to_the_end(hard: Case) -> None:
    seen = []

    def likely(window) -> bool:
        seen.append(window)
        return False

    windows_tried(hard, (10, 93), lambda _: False, likely=likely)
    tenth = [window for window in seen if window[1] - window[0] == 8]
    assert tenth == [*((start, start + 8) for start in range(10, 85, 2)), (85, 93)]
    lengths = sorted({end - first for first, end in seen})
    assert lengths == [8, 16, 32, 64]
    assert all(first >= 10 and end <= 93 for first, end in seen)


def test_short_cases_have_windows_of_four_frames(hard: Case) -> None:
    seen = []
    windows_tried(hard, (0, 9), lambda _: False, likely=lambda window: seen.append(window) or False)
    assert [window for window in seen if window[1] - window[0] == 4] == [(start, start + 4) for start in range(6)]


def test_a_window_that_is_likely_but_does_not_fail_is_doubled(hard: Case) -> None:
    ran = windows_tried(hard, (0, 80), lambda frames: frames[1] - frames[0] >= 30, likely=lambda w: w[0] <= 40 < w[1])
    assert [end - first for first, end in ran[:3]] == [8, 16, 32]
    assert all(first <= 40 < end for first, end in ran[:3])


def test_the_end_and_then_the_start_are_cut_by_half_and_then_by_smaller_steps(hard: Case) -> None:
    ran = windows_tried(hard, (0, 64), lambda w: w[0] <= 10 and w[1] >= 40, likely=lambda w: w == (0, 64))
    # Steps are halved after each failure, down to an eighth of the window.
    assert ran[:5] == [(0, 32), (0, 48), (0, 32), (0, 40), (0, 32)]
    assert ran[5:] == [(20, 40), (10, 40), (20, 40), (15, 40)]


def test_no_window_is_shorter_than_four_frames(hard: Case) -> None:
    ran = windows_tried(hard, (0, 40), lambda _: True)
    assert min(end - first for first, end in ran) == 4


def shrink_unlikely(hard: Case, whole, nuisances, fails, *, trials: int):
    """Shrink a case of which no part of the estimate seems to fail."""
    return shrink(hard, whole, is_likely=lambda _: False, nuisances=nuisances, fails=fails, trials=trials)


def test_trials_are_limited_and_described(hard: Case) -> None:
    nuisances = [nuisance for nuisance in nuisances_of(hard) if nuisance.name in ("blur", "noise")]
    found = shrink_unlikely(hard, (0, 8), nuisances, lambda case: case.camera.motion_blur, trials=20)
    assert found.window == (0, 4)
    assert (found.whole, found.removed) == ((0, 8), ("noise",))
    assert found.tried == (
        ("frames 0 to 3", True),
        ("frames 0 to 3 without blur, noise", False),
        ("frames 0 to 3 without blur", False),
        ("frames 0 to 3 without noise", True),
    )
    limited = shrink_unlikely(hard, (0, 8), nuisances, lambda case: case.camera.motion_blur, trials=2)
    assert limited.tried == found.tried[:2]
    assert limited.removed == ()


def test_all_nuisances_are_removed_at_once_if_it_fails_without_them(hard: Case) -> None:
    nuisances = [nuisance for nuisance in nuisances_of(hard) if nuisance.name in ("blur", "noise")]
    found = shrink_unlikely(hard, (0, 4), nuisances, lambda _: True, trials=20)
    assert found.removed == ("blur", "noise")
    assert len(found.tried) == 1
    single = shrink_unlikely(hard, (0, 4), nuisances[:1], lambda _: False, trials=20)
    assert len(single.tried) == 1


@pytest.mark.parametrize("number", ["3", "-3", "+0.25", "1.5e-07", "1e+9", "12.75"])
def test_numbers_of_any_form_do_not_count(number: str) -> None:
    assert Failure.of("lost", f"at {number} m").reason == "at # m"
