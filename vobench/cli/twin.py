"""A suite that repeats a recording in simulation, and how far both agree: vobench twin."""

import json as json_module
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from vobench.analysis.realism import Realism, measure, residual, shots_of
from vobench.analysis.twin import (
    Look,
    Placement,
    agreement,
    cell_disparities,
    fit_camera,
    levelled,
    look_of,
    place_path,
    segment_errors,
)
from vobench.cli import terminal
from vobench.cli.realism import facts_of, recording_at, rows_of
from vobench.cli.run import run_plan
from vobench.cli.sequence import Calibration, Form, FormCommand, Rate, TopicOf, Truth, topics_of
from vobench.dataset.layout import read
from vobench.dataset.picture import require_free
from vobench.dataset.recording import ReadOptions, Recording
from vobench.errors import InputError
from vobench.estimator.tools import stereo_pair
from vobench.geometry.rig import own_pair
from vobench.geometry.se3 import Array, inverse
from vobench.runner.folder import SEQUENCE, RunFolder, TrialScore, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.key import cache_folder
from vobench.runner.motion import body_motion
from vobench.runner.task import bake_task, perform
from vobench.suite import catalog
from vobench.suite.axis import RigSettings
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene
from vobench.suite.suite import read_plan
from vobench.suite.yaml_file import plain
from vobench.trajectory.formats import format_tum
from vobench.trajectory.trajectory import Trajectory, poses_at

COMMAND_CLASS = FormCommand
REAL, TWIN = "real", "twin"
ESTIMATORS: tuple[Any, ...] = (
    "lk_epipolar",
    {"name": "lk_epipolar", "label": "lk_epipolar_plain", "params": {"estimate_offset": 0}},
    "stereo_pnp",
    "feature_vo",
    "mono_vo",
    {"name": "stereo_pnp", "label": "stereo_pnp_wide", "params": {"window_px": 21}},
    "stand_still",
)
FEWEST_RANKED, FEWEST_PICTURES, LEAST_EXTENT_M = 3, 10, 0.05
TO_FIT = 12  # pictures that the camera is fitted to
KNOTS = 0.5  # of the smoothed path, a picture


def twin_command(
    path: Annotated[Path, typer.Argument(metavar="RECORDING", help="A recording with truth, or a run's case.")],
    *,
    place: Annotated[str, typer.Option(help="The scene or model that the path is laid into.")] = "office",
    out: Annotated[Path, typer.Option(help="The new folder for the suite, its runs and the report.")] = Path("twin"),
    estimator: Annotated[
        list[str] | None,
        typer.Option("--estimator", "-e", help="Run this one in place of the usual seven; repeatable."),
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Write the suite, and stop.")] = False,
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, envvar="VOBENCH_JOBS", help="Tasks at once.")] = 1,
    form: Form = None,
    calibration: Calibration = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: terminal.Json = False,
) -> None:
    """Repeat a recording in simulation, run the same estimators on both, and say how far they agree."""
    require_free(out)
    if estimator and len(estimator) < FEWEST_RANKED:
        raise InputError(f"an order needs {FEWEST_RANKED} estimators or more, and -e names {len(estimator)}")
    read_scene(catalog.find("scene", place).path)
    recording = recording_at(path, form, ReadOptions(calibration, None, truth, rate, topics=topics_of(topic)))
    found = measure(shots_of(recording), recording.rig)
    made = _made(recording, found, place, out)
    source: dict[str, Any] = {"path": str(_sequence(path)), "name": REAL, "form": form, "rate_hz": rate}
    source |= {"calibration": calibration and str(calibration.resolve()), "truth": truth and str(truth.resolve())}
    source |= {"topics": {name: value for name, value in plain_topics(topic).items() if value}}
    suite = {**made.suite, "source": [{key: value for key, value in source.items() if value}]}
    suite["estimators"] = list(estimator or ESTIMATORS)
    file = _write(out.resolve() / "twin.yaml", suite)
    _fit(file, suite, recording, gain=found.pair.gain if found.pair else 1.0)
    if dry_run:
        print(f"The suite is {file}")
        return
    folder = _run(file, out, jobs)
    twin = read(folder.case(TWIN) / SEQUENCE)
    report = _compared(folder, found, measure(shots_of(twin), twin.rig), made)
    _write(out / "twin.json", report.facts)
    if json:
        terminal.print_json(report.facts)
    else:
        report.print(out)


def plain_topics(topic: list[str] | None) -> dict[str, Any]:
    """The topics that were given, by what they are of."""
    topics = topics_of(topic)
    return {name: getattr(topics, name) for name in type(topics).__dataclass_fields__}


def _sequence(path: Path) -> Path:
    linked = path / SEQUENCE
    return (linked if linked.is_dir() else path).resolve()


def _write(path: Path, content: Any) -> Path:
    """JSON, which is YAML too."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json_module.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return path


@dataclass(frozen=True, slots=True)
class Made:
    """A twin's suite before its camera is fitted, and where its path was laid."""

    suite: dict[str, Any]
    placement: Placement


def _made(recording: Recording, found: Realism, place: str, out: Path) -> Made:
    """Lay the path into the place, and write path and place. Raises InputError where the recording lacks something."""
    if found.pair is None:
        raise InputError("a twin repeats a pair of eyes, and this recording has none that can be rectified and matched")
    if recording.truth is None:
        raise InputError("a twin repeats a path, and this recording has none; give one with --truth, say an estimate")
    t_ns = recording.t_ns[(recording.t_ns >= recording.truth.t_ns[0]) & (recording.t_ns <= recording.truth.t_ns[-1])]
    if len(t_ns) < FEWEST_PICTURES:
        raise InputError(
            f"a twin takes {FEWEST_PICTURES} pictures or more with a truth, and this recording has {len(t_ns)}"
        )
    T_world_left = poses_at(recording.truth, t_ns) @ recording.rig.T_body_left
    if np.linalg.norm(np.ptp(T_world_left[:, :3, 3], axis=0)) < LEAST_EXTENT_M:
        raise InputError(
            "a twin ranks estimators by errors per length of path, and this recording stands still; take one that moves"
        )
    if recording.form == "kitti":
        T_world_left = levelled(T_world_left)
    pair = stereo_pair(recording.rig, "the twin")
    spec = read_scene(catalog.find("scene", place).path)
    placement = place_path(build(spec, {}), T_world_left, pair, cell_disparities(found.pair, pair))
    rig = RigSettings(own=own_pair(recording.rig), pitch_deg=0, forward_m=0, height_m=0)
    T_world_body = placement.T_place_world @ T_world_left @ inverse(rig.build().T_body_left)
    _write(out / "place.yaml", {**plain(spec), "scale": spec.scale * placement.scale})
    (out / "path.tum").write_text(format_tum(Trajectory(t_ns - t_ns[0], T_world_body)), encoding="utf-8")
    rate_hz = round(1e9 / float(np.median(np.diff(t_ns))), 3)
    own: Any = plain(rig)
    suite: dict[str, Any] = {
        "name": "twin",
        "summary": f"A recording repeated in {place}",
        "scenes": [str((out / "place.yaml").resolve())],
        "rigs": {TWIN: {key: own[key] for key in ("own", "pitch_deg", "forward_m", "height_m")}},
        "trajectories": {TWIN: {"kind": "replay", "file": "path.tum", "rate_hz": rate_hz, "knot_hz": rate_hz * KNOTS}},
    }
    suite["rigs"][TWIN]["calibration_error"] = residual(found.pair)
    return Made(suite, placement)


def _fit(file: Path, suite: dict[str, Any], recording: Recording, *, gain: float) -> None:
    """Fit exposure, contrast, blur and noise to the recording's pictures, and write them into the suite.

    `gain` is of the right eye's grey values over the left one's.
    """
    from vobench.runner.simulate import open_renderer
    from vobench.runner.stereo_camera import World, exposed_by

    case = read_plan(str(file)).simulated[0]
    travel, scene = body_motion(case), case.build_scene()
    light = perform(bake_task(case.scene), cache_folder(), progress=terminal.Bars())
    wanted = _look_of(recording)
    stamps = travel.t_ns[np.linspace(0, len(travel.t_ns) - 1, TO_FIT).astype(int)].tolist()
    with closing(open_renderer(scene, case.rendering, light, white_cd_m2=case.scene.white_cd_m2)) as renderer:
        settings, _ = fit_camera(wanted, exposed_by(case, World(scene, renderer, travel.motion), stamps))
    chip = settings.chip
    suite["cameras"] = {
        TWIN: {
            "chip": {
                "full_well_e": chip.full_well_e,
                "read_noise_e": chip.read_noise_e,
                "shot_noise": True,
                "adc_bits": chip.adc_bits,
                "response": chip.response,
            },
            "exposure_gain": settings.exposure_gain,
            "blur_sigma_px": settings.blur_sigma_px,
            "unlike": {"right": {"gain": round(gain ** float(str(chip.response)), 4)}},
        }
    }
    _write(file, suite)


def _look_of(recording: Recording) -> Look:
    runs = shots_of(recording)
    shots = [shot.left for run in runs for shot in run]
    return look_of([shots[index] for index in np.linspace(0, len(shots) - 1, TO_FIT).astype(int)])


def _run(file: Path, out: Path, jobs: int) -> RunFolder:
    from vobench.report import page
    from vobench.runner.import_recording import read_all

    planned = read_plan(str(file))
    return run_plan(planned, read_all(planned), out=out / "runs", jobs=jobs, finish=page.write_reports)


def _errors(folder: RunFolder, case: str) -> dict[str, Array]:
    """Segments' errors of each estimator on a case."""
    gt = read_tum(folder.case(case) / GROUND_TRUTH)
    scores = [score for score in folder.scores() if score.case == case and score.repeat == 0]
    return {score.estimator: _segments(folder, gt, score) for score in scores}


def _segments(folder: RunFolder, gt: Trajectory, score: TrialScore) -> Array:
    est = read_tum(folder.estimate(score.case, score.estimator, 0) / "estimate.tum")
    return segment_errors(gt, est, scaled=any("Sim(3)" in claim for claim in score.claims))


@dataclass(frozen=True, slots=True)
class Report:
    """What a twin came to, as JSON holds it."""

    facts: dict[str, Any]

    def print(self, out: Path) -> None:
        """The order of the estimators, their errors, and the statistics side by side."""
        facts, console = self.facts, terminal.console()
        rows = [
            [e["estimator"], *(f"{e[side][key]:.3g}" for side in (REAL, TWIN) for key in ("mean", "p10", "p50", "p90"))]
            for e in facts["estimators"]
        ]
        names = [f"{side} {key}" for side in (REAL, TWIN) for key in ("mean", "10 %", "50 %", "90 %")]
        console.print(terminal.table("errors of segments, % of their length", ["estimator", *names], rows))
        low, high = facts["interval"]
        console.print(f"Kendall's tau between both orders: {facts['tau']:.2f} (95 %: {low:.2f} … {high:.2f})")
        stated = [
            [row["statistic"], f"{row['against']:.2f}", f"{row['value']:.2f}", row["unit"], row["is"]]
            for row in facts["statistics"]
        ]
        console.print(terminal.table("statistics", ["statistic", REAL, TWIN, "unit", "is"], stated))
        for name, (real, twin) in facts["also"].items():
            console.print(f"{name}: {real:.3g} in the recording, {twin:.3g} in its twin")
        place = facts["place"]
        console.print(
            f"The place is {place['scale']:g} times its own size; disparities differ by {place['misfit']:.0%} there."
        )
        console.print(f"Everything is in {out}")


def _compared(folder: RunFolder, real: Realism, twin: Realism, made: Made) -> Report:
    sides = {side: _errors(folder, side) for side in (REAL, TWIN)}
    order = agreement(sides[REAL], sides[TWIN])
    estimators = [
        {"estimator": name, **{side: _spread(sides[side][name]) for side in (REAL, TWIN)}}
        for name in sorted(order.errors, key=lambda name: order.errors[name][0])
    ]
    return Report(
        {
            "tau": order.tau,
            "interval": [order.low, order.high],
            "estimators": estimators,
            "statistics": [row for row in rows_of(twin, real) if row["against"] is not None],
            "also": _also(real, twin),
            "place": {"scale": made.placement.scale, "misfit": made.placement.misfit},
            "real": facts_of(real, None),
            "twin": facts_of(twin, None),
        }
    )


def _spread(errors: Array) -> dict[str, float]:
    known = errors[np.isfinite(errors)]
    p10, p50, p90 = np.quantile(known, [0.1, 0.5, 0.9]).tolist()
    return {"mean": float(known.mean()), "p10": p10, "p50": p50, "p90": p90}


def _also(real: Realism, twin: Realism) -> dict[str, tuple[float, float]]:
    also = {
        "noise where flat, DN": (real.also["noise_dn"], twin.also["noise_dn"]),
        "mean of grey, DN": (real.also["grey_mean"], twin.also["grey_mean"]),
        "sharpest edges, px": (real.also["edge_px"], twin.also["edge_px"]),
        "flow, px a picture": (real.also["flow_px"], twin.also["flow_px"]),
    }
    if real.pair and twin.pair:
        for name, unit in (("yaw_deg", "°"), ("roll_deg", "°"), ("pitch_deg", "°"), ("offset_px", " px")):
            pairs = getattr(real.pair, name), getattr(twin.pair, name)
            if all(pairs):
                also[f"{name.partition('_')[0]} of the right eye,{unit}"] = pairs[0].value, pairs[1].value
        for which, share in enumerate((10, 50, 90)):
            also[f"disparity, {share} % are below, px"] = real.pair.disparity_px[which], twin.pair.disparity_px[which]
    return also
