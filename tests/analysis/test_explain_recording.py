"""What a recording must have to be explained, and the estimates that are accepted."""

from pathlib import Path

import numpy as np
import pytest

from vobench.analysis.explain_recording import explain_recording
from vobench.errors import InputError, UnknownNameError
from vobench.geometry import se3
from vobench.runner.folder import RunFolder
from vobench.runner.recording import read_recording
from vobench.runner.store import SilentProgress
from vobench.suite.plan import Plan
from vobench.trajectory.trajectory import Trajectory, poses_at
from vobench.trajectory.tum import format_tum


def run_nothing(plan: Plan, /) -> RunFolder:
    raise AssertionError(f"nothing should be run, but {plan} was")


def write(folder: Path, trajectory: Trajectory) -> Path:
    file = folder / "estimate.tum"
    file.write_text(format_tum(trajectory))
    return file


@pytest.fixture
def body(recorded_case: Path) -> Trajectory:
    """The true poses of the body at the frames."""
    recording = read_recording(recorded_case)
    assert recording.truth is not None
    return Trajectory(recording.t_ns, poses_at(recording.truth, recording.t_ns))


@pytest.fixture
def T_body_left(recorded_case: Path) -> np.ndarray:
    return read_recording(recorded_case).rig.T_body_left


def explain(recorded_case: Path, estimate: Path, tmp_path: Path) -> None:
    explain_recording(recorded_case, run_plan=run_nothing, estimate=estimate, out=tmp_path / "out")


@pytest.mark.parametrize("is_of_camera", [False, True])
def test_an_estimate_without_errors_has_no_failing_frame(recorded_case, body, T_body_left, tmp_path, is_of_camera):
    est = body.of_mounted(T_body_left) if is_of_camera else body
    with pytest.raises(InputError, match=r"no frame has an error that is far above the others': the largest is 0\.0%"):
        explain(recorded_case, write(tmp_path, est), tmp_path)


def test_stamps_of_an_estimate_need_not_be_exactly_those_of_the_frames(recorded_case, body, tmp_path):
    late = Trajectory(body.t_ns + 2_000_000, body.T_world_frame)
    with pytest.raises(InputError, match="no frame has an error that is far above"):
        explain(recorded_case, write(tmp_path, late), tmp_path)


def test_an_estimate_of_another_time_is_refused(recorded_case, body, tmp_path):
    later = Trajectory(body.t_ns + 10**12, body.T_world_frame)
    with pytest.raises(InputError, match="no pose is at the time of a frame of the recording"):
        explain(recorded_case, write(tmp_path, later), tmp_path)


def test_a_short_recording_has_too_little_to_compare_its_failing_frames_with(recorded_case, body, tmp_path):
    middle = len(body) // 2
    after = (np.arange(len(body)) >= middle)[:, None]
    jump = se3.transform(np.eye(3), np.where(after, [1.0, 0.0, 0.0], 0.0))
    with pytest.raises(InputError, match="other frames or more in which the estimator does not fail"):
        explain(recorded_case, write(tmp_path, Trajectory(body.t_ns, jump @ body.T_world_frame)), tmp_path)


def test_a_folder_in_use_is_refused_before_anything_is_run(recorded_case, tmp_path):
    (tmp_path / "mine").write_text("")
    with pytest.raises(InputError):
        explain_recording(recorded_case, run_plan=run_nothing, estimator="lk_epipolar", out=tmp_path)


def test_the_cost_is_stated_before_anything_is_run(recorded_case, body, tmp_path) -> None:
    said: list[str] = []
    with pytest.raises(InputError, match="no frame has an error"):
        explain_recording(
            recorded_case,
            run_plan=run_nothing,
            estimate=write(tmp_path, body),
            out=tmp_path / "out",
            progress=SilentProgress(said.append),
        )
    (cost,) = said
    assert "the images of the worst" in cost
    assert "lk_epipolar runs in a twin of them, 18 times for one difference: about" in cost


def test_an_unknown_estimator_is_refused_before_anything_is_run(recorded_case, tmp_path):
    with pytest.raises(UnknownNameError, match="no estimator named 'lk_epipola'"):
        explain_recording(recorded_case, run_plan=run_nothing, estimator="lk_epipola", out=tmp_path / "out")
