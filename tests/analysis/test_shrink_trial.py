"""A failed trial shrinks to a suite on which it still fails alike."""

import pytest

from tests.analysis.conftest import NoisyRun
from vobench.analysis.shrink_trial import shrink_trial
from vobench.errors import InputError
from vobench.suite.suite import read_plan


@pytest.mark.usefixtures("cheap_pictures")
def test_a_failure_shrinks_to_a_suite_of_its_own(noisy_run: NoisyRun, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("VOBENCH_PATH", str(tmp_path))
    (tmp_path / "estimators").mkdir()
    (tmp_path / "estimators" / "blind").symlink_to(noisy_run.estimator)
    found = shrink_trial(noisy_run.trial("blind"), run_plan=noisy_run.run_plan, trials=2, folder=tmp_path / "small")

    first, end = found.found.window
    assert end - first <= found.frame_count / 2
    assert found.frame_count > found.score.frames  # the trajectory has more frames than came
    assert found.summary.startswith("blind: lost, ")
    assert found.as_dict()["frames"] == [first, end]
    assert found.to_frame()["fails_alike"].tolist() == [fails for _, fails in found.found.tried]

    (case,) = read_plan(str(found.suite)).simulated
    assert case.frames == (first, end)
    (again,) = noisy_run.run_plan(read_plan(str(found.suite))).scores()
    assert again.status == "lost"


def test_a_trial_that_does_not_fail_is_refused_before_anything_is_run(noisy_run: NoisyRun, tmp_path) -> None:
    def never(plan, /):
        raise AssertionError("nothing should be run")

    with pytest.raises(InputError, match="wheel_odometry on short is ok: nothing fails"):
        shrink_trial(noisy_run.trial("wheel_odometry"), run_plan=never, folder=tmp_path / "small")
    assert not (tmp_path / "small").exists()
