"""How well `vobench twin` predicts the errors of estimators on recordings whose properties were drawn by chance.

    python benchmarks/hidden_twins.py OUT [--recordings 8] [--seed 1] [--images 40] [--placements 2] [--again]

Recordings alternate between a car in generated streets and a hand in generated flats and offices. The errors of the
pair, the camera, its noise and the path are drawn by chance. Each is exported as KITTI or as EuRoC, and given to
`vobench twin`. Printed are the share of fitted errors of the pair that are inside of their 95 % intervals, Kendall's
tau of the predicted order of estimators, the share of predicted errors within a factor of 1.5 and inside of their
intervals, and how near surfaces are in the twin. OUT keeps everything, and the same command resumes.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.random import Generator
from pair_calibration import true_parameters
from realism import CAR_RIG, COVERED_SIGMAS

import vobench
from vobench.analysis.pair_parameter import (
    DISTORTION,
    RIGHT_CENTER_X,
    RIGHT_CENTER_Y,
    RIGHT_DISTORTION,
    RIGHT_TANGENTIAL_1,
    RIGHT_TANGENTIAL_2,
)
from vobench.analysis.rank_agreement import agreement
from vobench.analysis.realism_report import realism_of
from vobench.analysis.recorded_place import RECORDED
from vobench.analysis.recording_twin import case_errors
from vobench.analysis.twin_estimators import twin_estimators
from vobench.dataset.export import export
from vobench.geometry.rig import CalibrationError, CameraError
from vobench.runner.folder import open_run
from vobench.runner.recording import read_recording
from vobench.suite.yaml_file import plain

REFUSED = 1  # the exit code for wrong input
WITHIN = 1.5  # the factor by which a predicted error may differ
NEAREST = 1.5  # times the disparities of the recording
ESTIMATORS = ("lk_epipolar", "stereo_pnp", "stereo_pnp_wide", "feature_vo", "mono_vo")
FIRST_PLACE_SEED = 100  # of generated places, none of which a twin tries


# --- What is drawn ---


@dataclass(frozen=True, slots=True)
class Domain:
    """The place, the rig by form of export, and the path of recordings of one kind, and the place of their twin."""

    scenes: tuple[str, ...]
    rigs: Mapping[str, Mapping[str, Any]]
    trajectory: Mapping[str, Any]
    twin_place: str


HAND_RIGS = {
    "kitti": {"lens": "paper_blender", "picture_scale": 0.5, "pitch_deg": 0},
    "euroc": {"lens": "euroc", "picture_scale": 0.5, "pitch_deg": 0},
}
DOMAINS = {
    "car": Domain(
        scenes=("street",),
        rigs={"kitti": CAR_RIG, "euroc": CAR_RIG},
        trajectory={
            "kind": "wander",
            "body": "car",
            "length_m": 40,
            "rate_hz": 10,
            "mount": {"pitch_deg": 0, "forward_m": 1.5, "height_m": 1.6},
        },
        twin_place="street",
    ),
    "hand": Domain(
        scenes=("flat", "office"),
        rigs=HAND_RIGS,
        trajectory={
            "kind": "wander",
            "body": "hand",
            "length_m": 6,
            "rate_hz": 8,
            "mount": {"pitch_deg": 0, "forward_m": 0, "height_m": 0},
        },
        twin_place="office",
    ),
}
FORMS = ("kitti", "euroc")
ANGLE_PX = (0.3, 0.2, 0.4)  # usual errors by yaw and pitch at the centre, and by roll at the edges


@dataclass(frozen=True, slots=True)
class Hidden:
    """A recording that is drawn by chance: its name, domain, form of export, suite and the true errors of its pair."""

    name: str
    domain: Domain
    form: str
    suite: Mapping[str, Any]
    error: CalibrationError


def draw_recording(index: int, seed: int, images: int) -> Hidden:
    """The recording with a number."""
    rng = np.random.default_rng([seed, index])
    kind = list(DOMAINS)[index % len(DOMAINS)]
    domain = DOMAINS[kind]
    form = FORMS[index // len(DOMAINS) % len(FORMS)]
    error = _draw_error(rng)
    scene = domain.scenes[rng.integers(len(domain.scenes))]
    suite = {
        "name": "hidden",
        "seed": int(rng.integers(1, 10_000)),
        "scenes": [{"name": scene, "seed": FIRST_PLACE_SEED + int(rng.integers(100)), "lighting": "day"}],
        "rigs": {"rig": {**domain.rigs[form], "calibration_error": plain(error)}},
        "trajectories": {"path": domain.trajectory},
        "cameras": {"camera": _draw_camera(rng)},
        "frames": [0, images],
        "rendering": {"samples": 16},
        "estimators": ["stand_still"],
    }
    return Hidden(f"{index}-{kind}-{form}", domain, form, suite, error)


def _draw_error(rng: Generator) -> CalibrationError:
    """The errors of a pair. Half of the pairs have errors of the right lens too."""
    yaw_px, pitch_px, roll_px = ANGLE_PX * rng.standard_normal(3)
    focal_px = 340.0
    half_width_px = 200.0
    has_lens_error = rng.random() < 0.5
    center_x_px, center_y_px = has_lens_error * 2.0 * rng.standard_normal(2)
    tangential_1, tangential_2 = has_lens_error * 1e-3 * rng.standard_normal(2)
    right_focal, focal, baseline, common_x, common_y = rng.standard_normal(5)
    return CalibrationError(
        right_yaw_deg=float(np.degrees(yaw_px / focal_px)),
        right_pitch_deg=float(np.degrees(pitch_px / focal_px)),
        right_roll_deg=float(np.degrees(roll_px / half_width_px)),
        right=CameraError(
            focal_ratio=5e-4 * right_focal,
            center_px=(center_x_px, center_y_px),
            tangential=(tangential_1, tangential_2),
        ),
        focal_ratio=0.002 * focal,
        center_px=(1.0 * common_x, 1.0 * common_y),
        baseline_ratio=0.002 * baseline,
    )


def _draw_camera(rng: Generator) -> dict[str, Any]:
    """A camera with a drawn gain, exposure, blur and brightness of the right image."""
    gain_db = rng.uniform(0, 10)
    brightness = rng.uniform(0.8, 1.6)
    return {
        "sensor": "mt9v034",
        "gain_db": round(gain_db, 2),
        "exposure_gain": round(brightness * 10 ** (-gain_db / 20), 4),
        "blur_sigma_px": round(rng.uniform(0.3, 0.8), 3),
        "vignetting": round(rng.uniform(0.0, 0.5), 3),
        "unlike": {"right": {"gain": round(rng.uniform(0.85, 1.15), 3)}},
    }


# --- What is found ---


@dataclass(frozen=True, slots=True)
class Found:
    """What a fit and a twin state of a recording.

    `parameters` are rows of the name, value, standard deviation and truth of an error. `estimators` are rows of the
    name, predicted error, low and high end of its interval, and error on the recording, in percent.
    """

    parameters: list[tuple[str, float, float, float]]
    estimators: list[tuple[str, float, float, float, float]]
    tau: float
    nearness: float
    places: list[str]
    wall_s: float
    cpu_s: float

    def covered_parameters(self) -> list[bool]:
        """Whether the interval of each error of the pair holds the truth."""
        return [abs(value - truth) <= COVERED_SIGMAS * sigma for _, value, sigma, truth in self.parameters]

    def within(self) -> list[bool]:
        """Whether each predicted error is right within a factor."""
        return [max(expected / real, real / expected) <= WITHIN for _, expected, _, _, real in self.estimators]

    def covered(self) -> list[bool]:
        """Whether the interval of each predicted error holds that on the recording."""
        return [low <= real <= high for _, _, low, high, real in self.estimators]


def examine(hidden: Hidden, out: Path, placements: int, *, is_elsewhere: bool) -> Found | None:
    """Simulate and export a recording, fit its pair, and make its twin; what was found before is read again.

    None if `vobench twin` refuses the recording.
    """
    file = out / hidden.name / "found.json"
    if file.is_file():
        return Found(**json.loads(file.read_text(encoding="utf-8")))
    recording = _exported(hidden, out / hidden.name)
    parameters = _parameters(recording, hidden.error)

    twin = out / hidden.name / "twin"
    command = [sys.executable, "-m", "vobench", "twin", str(recording), "--form", hidden.form, "--out", str(twin)]
    place = hidden.domain.twin_place if is_elsewhere else RECORDED
    command += ["--place", place, "--placements", str(placements), "--json"]
    for estimator in ESTIMATORS:
        command += ["-e", estimator]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began_s = time.monotonic()
    finished = subprocess.run(command, stdout=subprocess.PIPE, check=False)
    if finished.returncode == REFUSED:
        return None
    finished.check_returncode()
    report = json.loads(finished.stdout)
    wall_s = time.monotonic() - began_s
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    found = Found(
        parameters=parameters,
        estimators=_predictions(report),
        tau=_tau(report),
        nearness=max(place["nearness"] for place in report["places"]),
        places=[f"{place['place']} × {place['scale']:.2f}" for place in report["places"]],
        wall_s=wall_s,
        cpu_s=after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime,
    )
    file.write_text(json.dumps(asdict(found)), encoding="utf-8")
    return found


def same_world_tau(hidden: Hidden, out: Path) -> float:
    """Kendall's tau of two simulations of a recording that differ by noise: the most that a twin can reach."""
    suite = {**hidden.suite, "estimators": twin_estimators(ESTIMATORS), "repeats": 2}
    file = out / hidden.name / "again.yaml"
    file.write_text(json.dumps(suite, indent=1), encoding="utf-8")
    run = vobench.run(str(file), out=out / hidden.name / "again", jobs=1, quiet=True)
    folder = open_run(run.path)
    case_names = sorted({score.case for score in folder.scores()})
    first, second = (case_errors(folder, name) for name in case_names)
    return agreement(first, second).tau


def _exported(hidden: Hidden, folder: Path) -> Path:
    """The folder of the recording in its form."""
    recording = folder / hidden.form
    if not recording.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        suite = folder / "hidden.yaml"
        suite.write_text(json.dumps(hidden.suite, indent=1), encoding="utf-8")
        simulation = vobench.simulate(str(suite), quiet=True)
        export(simulation.path, recording, hidden.form)
    return recording


def _parameters(recording: Path, error: CalibrationError) -> list[tuple[str, float, float, float]]:
    """The fitted errors of the pair, with their standard deviations and the truth."""
    pair = realism_of(read_recording(recording)).pair
    if pair is None or pair.calibrated is None:
        return []
    truths = all_true_parameters(error)
    rows = []
    for parameter in pair.calibrated.calibration.parameters:
        value, sigma = pair.calibrated.calibration.value(parameter.name)
        rows.append((parameter.name, value, sigma, truths[parameter.name]))
    return rows


def all_true_parameters(error: CalibrationError) -> dict[str, float]:
    """The true values of all errors that can be fitted, by name."""
    return true_parameters(error) | {
        DISTORTION: error.distortion_ratio,
        RIGHT_CENTER_X: error.right.center_px[0],
        RIGHT_CENTER_Y: error.right.center_px[1],
        RIGHT_TANGENTIAL_1: error.right.tangential[0],
        RIGHT_TANGENTIAL_2: error.right.tangential[1],
        RIGHT_DISTORTION: error.right.distortion_ratio,
    }


def _predictions(report: Mapping[str, Any]) -> list[tuple[str, float, float, float, float]]:
    """The predicted errors, their intervals, and the errors on the recording."""
    real = {row["estimator"]: row["real"]["mean"] for row in report["estimators"]}
    rows = []
    for predicted in report["prediction"]["estimators"]:
        name = predicted["estimator"]
        low, high = predicted["interval"] or (np.nan, np.nan)
        if name in real:
            rows.append((name, predicted["error"], low, high, real[name]))
    return rows


def _tau(report: Mapping[str, Any]) -> float:
    """Kendall's tau of the predicted errors and those on the recording."""
    from scipy.stats import kendalltau

    rows = _predictions(report)
    return float(kendalltau([row[1] for row in rows], [row[4] for row in rows]).statistic)


# --- Report ---


def _print(hidden: Hidden, found: Found) -> None:
    """Print what was found of one recording."""
    is_covered = found.covered_parameters()
    print(
        f"{hidden.name}: {sum(is_covered)} of {len(is_covered)} errors of the pair in their intervals, "
        f"tau {found.tau:.2f}, {sum(found.within())} of {len(found.estimators)} errors within {WITHIN}, "
        f"{sum(found.covered())} in their intervals, nearness {found.nearness:.2f}, {', '.join(found.places)}; "
        f"{found.wall_s:.0f} s, {found.cpu_s:.0f} CPU s"
    )
    for (name, value, sigma, truth), covered in zip(found.parameters, is_covered, strict=True):
        print(f"    {name:20} {value:+.5f} ± {sigma:.5f}, true {truth:+.5f}{'' if covered else '  MISSED'}")
    for (name, expected, low, high, real), covered in zip(found.estimators, found.covered(), strict=True):
        mark = "" if covered else "  MISSED"
        print(f"    {name:20} {expected:.3g} % ({low:.3g} … {high:.3g}), on the recording {real:.3g} %{mark}")
    sys.stdout.flush()


def _print_summary(all_found: Sequence[Found]) -> None:
    """Print the shares over all recordings."""
    parameters = [covered for found in all_found for covered in found.covered_parameters()]
    within = [right for found in all_found for right in found.within()]
    covered = [right for found in all_found for right in found.covered()]
    taus = [found.tau for found in all_found]
    near = sum(found.nearness > NEAREST for found in all_found)
    print(f"{len(all_found)} recordings that were not refused")
    print(f"errors of the pair inside of their 95 % intervals: {np.mean(parameters):.1%} of {len(parameters)}")
    print(f"Kendall's tau of predicted orders: mean {np.mean(taus):.2f}, least {min(taus):.2f}")
    print(f"predicted errors within a factor of {WITHIN}: {np.mean(within):.1%} of {len(within)}")
    print(f"errors inside of their predicted intervals: {np.mean(covered):.1%} of {len(covered)}")
    print(f"twins with a tenth of disparities over {NEAREST} times the recording's: {near}")


def main() -> None:
    """Examine the recordings one after the other."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--recordings", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--images", type=int, default=40)
    parser.add_argument("--other-place", action="store_true", help="put twins into a place of the same kind instead")
    parser.add_argument("--placements", type=int, default=2)
    parser.add_argument("--again", action="store_true", help="print tau of two simulations of each recording instead")
    options = parser.parse_args()
    if options.again:
        for index in range(options.recordings):
            hidden = draw_recording(index, options.seed, options.images)
            print(f"{hidden.name}: tau of two simulations {same_world_tau(hidden, options.out):.2f}", flush=True)
        return
    all_found = []
    for index in range(options.recordings):
        hidden = draw_recording(index, options.seed, options.images)
        found = examine(hidden, options.out, options.placements, is_elsewhere=options.other_place)
        if found is None:
            print(f"{hidden.name}: refused", flush=True)
            continue
        _print(hidden, found)
        all_found.append(found)
    _print_summary(all_found)


if __name__ == "__main__":
    main()
