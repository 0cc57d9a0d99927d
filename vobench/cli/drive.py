"""vobench drive."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from vobench.cli import terminal
from vobench.cli.identify import REFERENCES, RIMS
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.course import Unled
from vobench.motion.drive import Waypoints
from vobench.motion.motor import loop_voltages, wheel_voltages
from vobench.motion.wheeled import Wheeled
from vobench.report.drive_plot import ENDINGS, DriveLog, save_plot
from vobench.runner.motion import BodyMotion, body_motion, check_cases
from vobench.runner.sensors import wheel_error_m
from vobench.suite.suite import Case, Plan, read_plan
from vobench.trajectory.formats import format_tum
from vobench.trajectory.kinematics import Kinematics
from vobench.trajectory.trajectory import Trajectory

HEADINGS = (
    *("trajectory", "kind", "frames", "seconds", "path m", "max m/s", "max °/s", "°/frame"),
    *("wheels off m", "max V", "legs end at s"),
)


@dataclass(frozen=True, slots=True)
class Driven:
    """One trajectory of a suite, gone; `refusals` say where its cases' cameras cannot be."""

    name: str
    case: Case
    travel: BodyMotion
    body: Kinematics
    refusals: tuple[str, ...]

    @property
    def kind(self) -> str:
        """What it is, and who goes it."""
        spec = self.case.trajectory
        return f"{spec.kind}, {spec.mover}" if isinstance(spec, Wheeled) else spec.kind

    @property
    def reached_s(self) -> Array | None:
        """When the leg to each target ended, where there are targets."""
        if self.travel.drive is None or not isinstance(self.case.trajectory, Waypoints):
            return None
        return self.travel.drive.t_ns[list(self.travel.drive.reached)] / 1e9

    @property
    def rows(self) -> slice:
        """Which frames of the whole drive its pictures are of."""
        return slice(self.travel.first, self.travel.first + len(self.travel.t_ns))

    @property
    def volts(self) -> Array | None:
        """Voltages (N, 2) that the left and the right motor are asked for, where their constants are given."""
        drive, spec = self.travel.drive, self.case.trajectory
        if drive is None or not isinstance(spec, Wheeled) or spec.motors is None:
            return None
        u, omega = drive.state[:, 3:].T
        v_u, v_omega = loop_voltages((u, omega), tuple(drive.references.T), tuple(drive.rates.T), motors=spec.motors)
        return np.stack(wheel_voltages(v_u, v_omega), -1)[self.rows]


def _chosen(plan: Plan, trajectory: str | None) -> list[str]:
    known = list(plan.suite.trajectories or {})
    if not known:
        raise InputError(f"suite '{plan.suite.name}' has no trajectory to drive, only recordings or scenarios")
    return known if trajectory is None else [terminal.known("trajectory", trajectory, known)]


def _check_files(out: Path | None, exports: list[Path], names: list[str]) -> None:
    """Said before the driving. Raises InputError."""
    if out and out.suffix not in ENDINGS:
        raise InputError(f"--out should end in {', '.join(ENDINGS)}, got {out}")
    if exports and len(names) > 1:
        raise InputError(f"--tum and --csv are for one trajectory; choose one with --trajectory: {', '.join(names)}")
    for path in [out, *exports]:
        if path and (path.is_dir() or not path.parent.is_dir()):
            raise InputError(f"should be a file in a folder that exists: {path}")


def drive_one(plan: Plan, name: str) -> Driven:
    """One trajectory of a plan, gone. Raises SuiteError where that cannot be."""
    cases = [case for case in plan.simulated if case.variant["trajectory"] == name]
    wrong = plan.mistakes()
    with wrong.at("trajectories", name):
        travel = body_motion(cases[0])
    wrong.require_none()
    check_cases(cases, travel, wrong)
    return Driven(name, cases[0], travel, travel.at_frames(), tuple(dict.fromkeys(map(str, wrong.found))))


def log_of(driven: Driven) -> DriveLog:
    """What there is to draw of it."""
    drive, spec = driven.travel.drive, driven.case.trajectory
    return DriveLog(
        title=driven.kind if driven.name == spec.kind else f"{driven.name}: {driven.kind}",
        t_s=driven.travel.t_ns / 1e9,
        T_world_body=driven.body.T_world_body,
        twist=driven.body.twist,
        point_m=drive.state[driven.rows, :2] if drive and not isinstance(spec, Unled) else None,
        references=drive.references[driven.rows] if drive else None,
        targets_m=np.array(spec.targets_m) if isinstance(spec, Waypoints) else None,
        reached_s=driven.reached_s,
        patches=tuple((patch.surface, patch.corners_m) for patch in spec.floor) if isinstance(spec, Wheeled) else (),
    )


def _facts(driven: Driven) -> dict[str, Any]:
    body, travel = driven.body, driven.travel
    R = body.T_world_body[:, :3, :3]
    turns = se3.rotation_angle(np.swapaxes(R[:-1], -1, -2) @ R[1:]) if len(R) > 1 else np.zeros(1)
    steps_m = np.linalg.norm(np.diff(body.T_world_body[:, :3, 3], axis=0), axis=1)
    return {
        "trajectory": driven.name,
        "kind": driven.kind,
        "frames": len(travel.t_ns),
        "duration_s": float(travel.t_ns[-1] - travel.t_ns[0]) / 1e9,
        "path_m": float(steps_m.sum()),
        "max_speed_mps": float(np.linalg.norm(body.velocity_mps, axis=1).max()),
        "max_turn_degps": float(np.rad2deg(np.linalg.norm(body.turn_radps, axis=1).max())),
        "max_turn_per_frame_deg": float(np.rad2deg(turns.max())),
        "wheel_error_m": wheel_error_m(driven.case, travel),
        "peak_V": None if driven.volts is None else float(np.abs(driven.volts).max()),
        "reached_s": None if driven.reached_s is None else driven.reached_s.tolist(),
        "refused": list(driven.refusals),
    }


def _print(driven: list[Driven], files: list[Path], *, as_json: bool) -> None:
    facts = [_facts(one) for one in driven]
    if as_json:
        terminal.print_json({"trajectories": facts, "files": list(map(str, files))})
        return
    out = terminal.console()
    out.print(terminal.table("", HEADINGS, map(_row, facts)))
    for said in dict.fromkeys(said for one in driven for said in one.refusals):
        out.print(f"vobench run will refuse this: {said}")
    for path in files:
        out.print(str(path))


def _row(f: dict[str, Any]) -> list[str]:
    off_m, peak_V, reached_s = f["wheel_error_m"], f["peak_V"], f["reached_s"]
    return [
        f["trajectory"],
        f["kind"],
        str(f["frames"]),
        f"{f['duration_s']:.1f}",
        f"{f['path_m']:.2f}",
        f"{f['max_speed_mps']:.2f}",
        f"{f['max_turn_degps']:.0f}",
        f"{f['max_turn_per_frame_deg']:.1f}",
        "" if off_m is None else f"{off_m:.3f}",
        "" if peak_V is None else f"{peak_V:.1f}",
        "" if reached_s is None else " ".join(f"{at_s:.2f}" for at_s in reached_s),
    ]


def _csv(driven: Driven) -> str:
    """The body's true motion at its frames, velocities and accelerations in its own axes; then its wheels and motors.

    What the wheels' rims turned, what the controller asked for and what the motors got are there where they exist.
    """
    body, travel = driven.body, driven.travel
    at_m, q_xyzw = body.T_world_body[:, :3, 3], se3.to_quaternion(body.T_world_body[:, :3, :3])
    columns: list[tuple[str, Array | None]] = [
        ("x_m,y_m,z_m,qx,qy,qz,qw", np.concatenate([at_m, q_xyzw], -1)),
        ("vx_mps,vy_mps,vz_mps,wx_radps,wy_radps,wz_radps", body.twist),
        ("ax_mps2,ay_mps2,az_mps2", body.acceleration_mps2),
        (",".join(RIMS), travel.rims.rim_rad[np.searchsorted(travel.rims.t_ns, travel.t_ns)] if travel.rims else None),
        (",".join(REFERENCES), travel.drive.references[driven.rows] if travel.drive else None),
        ("left_V,right_V", driven.volts),
    ]
    known = [(names, values) for names, values in columns if values is not None]
    rows = zip(travel.t_ns.tolist(), np.concatenate([values for _, values in known], -1).tolist(), strict=True)
    heading = ",".join(["t_ns", *(names for names, _ in known)])
    return "".join([f"{heading}\n", *(f"{t},{','.join(map(repr, row))}\n" for t, row in rows)])


def drive_command(
    suite: terminal.SuiteName,
    *,
    trajectory: Annotated[str | None, typer.Option("--trajectory", "-t", help="Only this one of the suite's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Plot paths and speeds to this .svg, .png or .pdf.")] = None,
    tum: Annotated[Path | None, typer.Option(help="Write the body's true path of one trajectory, as TUM.")] = None,
    csv: Annotated[
        Path | None, typer.Option(help="The same with speeds, wheels, references and voltages, as CSV.")
    ] = None,
    trust: terminal.Trust = False,
    json: terminal.Json = False,
) -> None:
    """Drive a suite's trajectories without rendering: a summary, and plots."""
    del trust  # done by its callback
    plan = read_plan(suite)
    names = _chosen(plan, trajectory)
    _check_files(out, [path for path in (tum, csv) if path], names)
    driven = [drive_one(plan, name) for name in names]
    if out:
        save_plot(out, [log_of(one) for one in driven])
    if tum:
        tum.write_text(format_tum(Trajectory(driven[0].travel.t_ns, driven[0].body.T_world_body)), encoding="utf-8")
    if csv:
        csv.write_text(_csv(driven[0]), encoding="utf-8")
    _print(driven, [path for path in (out, tum, csv) if path], as_json=json)
