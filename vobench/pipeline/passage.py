"""Whether a suite's bodies can go where they are sent: known before anything is rendered."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vobench import stop
from vobench.catalog.yaml_file import Mistakes
from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.pipeline.motion import Travel, travel_of
from vobench.suite.expand import Case, Plan
from vobench.suite.replay_spec import ReplaySpec
from vobench.suite.scene_file import movers


def travel_all(plan: Plan) -> dict[str, Travel]:
    """The travel of each trajectory of a plan, by its name: said before hours of rendering.

    Raises SuiteError with all that is wrong: a target cannot be reached, a way ends within a frame, a camera
    leaves the room, its pictures take longer than a frame, or an IMU would feel the noise of a recording.
    """
    travels, wrong = dict[str, Travel](), plan.mistakes()
    for name, cases in _by(plan.simulated, "trajectory").items():
        stop.check()
        with wrong.at("trajectories", name):
            travels[name] = travel_of(cases[0])
            check_cases(cases, travels[name], wrong)
    wrong.require_none()
    return travels


def check_cases(cases: Sequence[Case], travel: Travel, wrong: Mistakes) -> None:
    """Gather why these cases of one trajectory cannot be: `travel` is the trajectory's."""
    trajectory = cases[0].variant["trajectory"]
    with wrong.at("trajectories", trajectory):
        _check_lasts(cases[0], travel)
    for case, *_ in _by(cases, "scene", "rig").values():
        with wrong.at("trajectories", trajectory):
            _check_in_room(case, travel)
            _check_smooth(case)
    for camera, (case, *_) in _by(cases, "camera").items():
        with wrong.at("cameras", camera):
            _check_fits_frame(case)


def _by(cases: Sequence[Case], *axes: str) -> dict[str, list[Case]]:
    """The cases of each combination of variants on these axes."""
    of = dict[str, list[Case]]()
    for case in cases:
        of.setdefault(" ".join(case.variant[axis] for axis in axes), []).append(case)
    return of


def _check_lasts(case: Case, travel: Travel) -> None:
    """Raise MotionError where there would be a single picture."""
    if len(travel.t_ns) < 2:
        raise MotionError(
            f"the way ends within its first frame at {case.trajectory.rate_hz:g} Hz: one picture shows no motion; "
            "go further, more slowly or with a higher rate_hz"
        )


def _check_smooth(case: Case) -> None:
    if isinstance(case.trajectory, ReplaySpec) and case.trajectory.exact and case.rig.imu:
        raise MotionError(
            f"the IMU of rig '{case.variant['rig']}' would feel the noise of an exact replay; "
            "leave exact out, or the IMU"
        )


def _check_fits_frame(case: Case) -> None:
    """Raise MotionError where a picture would still be exposed or read out when the next one begins."""
    camera, frame_ms = case.camera, 1e3 / case.trajectory.rate_hz
    durations = {"exposure_ms": camera.exposure_ms, "readout_ms": camera.readout_ms or 0.0}
    if camera.auto_exposure:
        durations["auto_exposure.t_max_ms"] = camera.auto_exposure.t_max_ms
    for key, lasts_ms in durations.items():
        if lasts_ms > frame_ms:
            raise MotionError(
                f"{key} {lasts_ms:g} is longer than a frame of trajectory '{case.variant['trajectory']}', "
                f"which lasts {frame_ms:.3g} ms at {case.trajectory.rate_hz:g} Hz"
            )


def _check_in_room(case: Case, travel: Travel) -> None:
    rig, room, T_world_body = case.build_rig(), case.scene.room, travel.at_frames().T_world_body
    for T_body_camera in map(rig.T_body_camera, rig.sides):
        at_m = (T_world_body @ T_body_camera)[:, :3, 3]
        outside = ~room.holds(at_m)
        is_under = at_m[np.argmax(outside), 2] <= 0
        _refuse(case, travel, at_m, outside, "is under the floor" if is_under else f"leaves the room ({room.extent})")
        for b in case.scene.boxes:
            T_world_box = se3.transform(se3.rotation_z(np.deg2rad(b.yaw_deg)), b.center_m)
            inside = _within(at_m, T_world_box, b.size_m)
            _refuse(case, travel, at_m, inside, f"is inside the box of {b.material} at {b.center_m} m")
        for spec, mover in zip(case.scene.movers, movers(case.scene), strict=True):
            T_world_mover = np.stack([mover.path.pose(t_ns) for t_ns in travel.t_ns])
            inside = _within(at_m, T_world_mover, spec.size_m)
            _refuse(case, travel, at_m, inside, f"is inside the mover '{spec.name}'")


def _within(at_m: Array, T_world_box: Array, size_m: tuple[float, float, float]) -> NDArray[np.bool_]:
    """Which points (N, 3) are within a box around the origin of its frame, (4, 4) or (N, 4, 4)."""
    in_box_m = se3.apply(se3.inverse(T_world_box), at_m[:, None])[:, 0]
    within: NDArray[np.bool_] = np.all(np.abs(in_box_m) <= np.array(size_m) / 2, axis=-1)
    return within


def _refuse(case: Case, travel: Travel, at_m: Array, wrong: NDArray[np.bool_], what: str) -> None:
    """Raise MotionError for the first instant at which a camera is where it cannot be."""
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        where = ", ".join(f"{x:.2f}" for x in at_m[first])
        raise MotionError(
            f"a camera of rig '{case.variant['rig']}' {what} of scene '{case.variant['scene']}' "
            f"after {travel.t_ns[first] / 1e9:.1f} s, at ({where}) m"
        )
