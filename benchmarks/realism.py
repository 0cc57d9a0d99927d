"""How often the calibration of simulated pairs is judged rightly by the measurements of `vobench realism`.

    python benchmarks/realism.py [--drives 8] [--seed 1] [--place room ...] [--worn 8]

A pair without errors is driven through six places along paths that are drawn by chance. Printed are the errors that are
found for it all the same. `--worn` drives that many worn pairs, whose errors are drawn too, through the street, and
prints how often the 95 % intervals of their yaw, roll and pitch hold the truth. Promised: nothing is found for a pair
without errors in at least 95 % of cases.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import vobench
from vobench.analysis.pair_parameter import PITCH, ROLL, YAW
from vobench.analysis.realism import MIN_GAIN_DIFFERENCE, residual
from vobench.analysis.realism_report import realism_of
from vobench.analysis.stereo_fit import StereoFit
from vobench.geometry.rig import CalibrationError, drawn_calibration_error
from vobench.runner.recording import read_recording
from vobench.suite.case import CALIBRATION_STREAM, Case

IMAGES = 28  # two runs of images
COVERED_SIGMAS = 1.96
INDOOR_RIG = {"lens": "paper_blender", "picture_scale": 0.5, "pitch_deg": 10, "height_m": 1.2}
CAR_RIG = {
    "own": {
        "left": {"size_px": [613, 185], "focal_px": [353.5, 353.5], "center_px": [300.5, 91.5]},
        "right_at_m": [0.537, 0, 0],
    },
    "pitch_deg": 0,
}
HAND = {"kind": "wander", "body": "hand", "length_m": 4, "rate_hz": 8, "mount": {"height_m": 0}}
ROBOT = {"kind": "wander", "body": "pioneer", "length_m": 3, "rate_hz": 8}
CAR = {"kind": "wander", "body": "car", "length_m": 36, "rate_hz": 8, "mount": {"forward_m": 1.5, "height_m": 1.6}}
PLACES: Mapping[str, tuple[Mapping[str, Any], Mapping[str, Any]]] = {
    "room": (INDOOR_RIG, ROBOT),
    "office": (INDOOR_RIG, HAND),
    "flat": (INDOOR_RIG, ROBOT),
    "warehouse": (INDOOR_RIG, HAND),
    "park": (INDOOR_RIG, HAND),
    "street": (CAR_RIG, CAR),
}


def fit_of_drive(place: str, seed: int, error: str) -> tuple[StereoFit | None, CalibrationError]:
    """The fit of a pair that is driven through a place, and the errors that it has."""
    rig, trajectory = PLACES[place]
    suite = {
        "name": "pair",
        "seed": seed,
        "scenes": [place],
        "rigs": {"rig": {**rig, "calibration_error": {"level": error}}},
        "trajectories": {"path": trajectory},
        "cameras": {"camera": {"sensor": "mt9v034", "gain_db": 4, "exposure_gain": 1.5, "blur_sigma_px": 0.35}},
        "frames": [0, IMAGES],
        "estimators": ["stand_still"],
    }
    with TemporaryDirectory() as folder:
        file = Path(folder) / "pair.yaml"
        file.write_text(json.dumps(suite), encoding="utf-8")
        simulation = vobench.simulate(str(file), quiet=True)
        recording = read_recording(simulation.path)
    assert isinstance(simulation.case, Case)
    return realism_of(recording).pair, error_of(simulation.case)


def error_of(case: Case) -> CalibrationError:
    """The errors of a case's pair, which are drawn by its seed."""
    rng = np.random.default_rng([case.seed, CALIBRATION_STREAM])
    return drawn_calibration_error(case.rig.calibration_error, case.build_rig(), rng)


def findings(fit: StereoFit) -> list[str]:
    """The names of the errors that are found for a pair."""
    names = list(residual(fit))
    if abs(fit.gain - 1) > MIN_GAIN_DIFFERENCE:
        names.append("gain")
    return names


def print_perfect(places: list[str], drives: int, first_seed: int) -> None:
    """Print what is found for pairs without errors."""
    judged = 0
    clean = 0
    for place in places:
        for seed in range(first_seed, first_seed + drives):
            fit, _ = fit_of_drive(place, seed, "none")
            if fit is None:
                print(f"{place} {seed}: too few matches", flush=True)
                continue
            names = findings(fit)
            judged += 1
            clean += not names
            print(f"{place} {seed}: {', '.join(names) or 'nothing found'}; {_angles_text(fit)}", flush=True)
    print(f"nothing found for {clean} of {judged} pairs without errors")


def print_worn(drives: int, first_seed: int) -> None:
    """Print the errors that are found for worn pairs in the street, and how often intervals hold the truth."""
    covered = dict.fromkeys((YAW, ROLL, PITCH), 0)
    for seed in range(first_seed, first_seed + drives):
        fit, error = fit_of_drive("street", seed, "worn")
        assert fit is not None
        assert fit.calibrated is not None
        texts = []
        for name in covered:
            value, sigma = fit.calibrated.calibration.value(name)
            truth = getattr(error, name)
            is_covered = abs(value - truth) <= COVERED_SIGMAS * sigma
            covered[name] += is_covered
            texts.append(f"{name} {value:+.4f} ± {sigma:.4f}, true {truth:+.4f}{'' if is_covered else ' MISSED'}")
        print(f"street {seed}: {'; '.join(texts)}", flush=True)
    for name, count in covered.items():
        print(f"{name}: {count} of {drives} intervals hold the truth")


def _angles_text(fit: StereoFit) -> str:
    """The angles of a fit and its offset, with their standard deviations."""
    estimates = {"yaw": fit.yaw_deg, "roll": fit.roll_deg, "pitch": fit.pitch_deg, "offset px": fit.offset_px}
    texts = [f"{name} {each.value:+.4f} ± {each.sigma:.4f}" for name, each in estimates.items() if each is not None]
    return ", ".join(texts)


def main() -> None:
    """Judge pairs without errors, or worn ones."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drives", type=int, default=8, help="of each place")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--place", nargs="+", choices=list(PLACES), default=list(PLACES))
    parser.add_argument("--worn", type=int, metavar="DRIVES")
    options = parser.parse_args()
    if options.worn:
        print_worn(options.worn, options.seed)
    else:
        print_perfect(options.place, options.drives, options.seed)


if __name__ == "__main__":
    main()
