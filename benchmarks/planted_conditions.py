"""How often `causes` is right, on weaknesses that are drawn by seed and whose condition is known, without pictures.

    python benchmarks/planted_conditions.py [--draws 20] [--first 1000] [--drives 1 3] [--without darkness]

The conditions of twelve cases are drawn with what they have in reality: those of the drive, such as flow, turn and
depth, are the same in all cases on it, those of the camera, such as calibration and noise, differ between cases, and
light and movers do both. An estimator fails in the frames in which its weakness is triggered, and its error is a share
of the step, so that short steps weigh more.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from vobench.analysis.causes import Attribution, ErrorSeries, attribute
from vobench.geometry.se3 import Array

CASES = 12
FRAMES = 48
MEAN_STEP_M = 0.12
FAULT_M = 0.02  # the error of a frame in which the weakness is triggered
DARK_DN = 65.0

Mask = NDArray[np.bool_]
# What is true of each weakness: the conditions that may be named for it.
TRUE_CONDITIONS: dict[str, set[str]] = {
    "dark": {"darkness"},
    "turn": {"turn", "flow", "short_steps"},
    "flow": {"flow", "turn", "short_steps"},
    "moving": {"moving"},
    "jump": {"light_jump"},
    "faint": {"faintness"},
    "left eye": {"unlike_eyes"},
    "calibration": {"calibration"},
    "far": {"disparity", "depth"},
    "dark and moving": {"darkness", "moving"},
    "calibration or moving": {"calibration", "moving"},
    "faint or calibration": {"faintness", "calibration"},
    "after N frames": {"since_start"},
    "clock": set(),
    "coin": set(),
    "bursts": set(),
    "none": {"short_steps", "flow", "turn"},
}


@dataclass(frozen=True, slots=True)
class Drive:
    """What all cases on a drive share: (FRAMES,) each."""

    step_m: Array
    turn_deg: Array
    depth_m: Array
    faintness: Array
    movers: Array
    dimmer: Array
    shadow_edge: Array


@dataclass(frozen=True, slots=True)
class DrawnCase:
    """The conditions of a case, its drive, and the mean grey value of its frames."""

    conditions: Mapping[str, Array]
    drive: int
    step_m: Array
    grey_dn: Array


def smooth_noise(rng: Generator, width: int) -> Array:
    """Noise (FRAMES,) of mean 0 and standard deviation 1, smooth over some frames."""
    margin = 4 * width
    white = rng.standard_normal(FRAMES + 2 * margin)
    offsets = np.arange(-3 * width, 3 * width + 1) / width
    smooth = np.convolve(white, np.exp(-0.5 * offsets**2), "same")[margin : margin + FRAMES]
    return np.asarray((smooth - smooth.mean()) / smooth.std())


def draw_drive(rng: Generator) -> Drive:
    """A round with four corners, on which the body is slower, among things and lamps that dim twice."""
    phase = rng.uniform(0, 2 * np.pi)
    corner = np.clip(2 * np.sin(np.arange(FRAMES) / FRAMES * 8 * np.pi + phase) - 0.8, 0, 1)
    dimmer = np.ones(FRAMES)
    for start in rng.uniform(0.1, 0.8, 2):
        dimmer[int(start * FRAMES) : int((start + 0.15) * FRAMES)] = 0.35
    return Drive(
        step_m=MEAN_STEP_M * np.exp(0.15 * smooth_noise(rng, 4)) * (1 - 0.5 * corner),
        turn_deg=1 + 9 * corner + 0.3 * rng.random(FRAMES),
        depth_m=2.5 * np.exp(0.3 * smooth_noise(rng, 4)),
        faintness=np.exp(0.3 * smooth_noise(rng, 5)),
        movers=0.15 * np.clip(smooth_noise(rng, 5), 0, None),
        dimmer=dimmer,
        shadow_edge=np.clip(0.02 + 0.01 * smooth_noise(rng, 3), 0, None),
    )


def draw_case(rng: Generator, drive: Drive, number: int) -> DrawnCase:
    """A case on a drive, with about a third of all difficulties."""
    has = dict(zip(("dimmer", "dirt", "movers", "faint", "blur", "noise", "calibration", "eyes", "drops"),
                   rng.random(9) < 0.35, strict=True))  # fmt: skip
    everywhere = np.ones(FRAMES)
    grey_dn = 110 * np.exp(0.05 * smooth_noise(rng, 3))
    if has["dimmer"]:
        grey_dn = grey_dn * drive.dimmer
    if has["dirt"]:
        grey_dn = grey_dn * 0.5
    stops = np.log2(grey_dn)
    flow_px = 3 * drive.turn_deg + 100 * drive.step_m / drive.depth_m
    conditions = {
        "moving": drive.movers * has["movers"],
        "shadow_edge": drive.shadow_edge,
        "faintness": drive.faintness * (10.0 if has["faint"] else 4.0),
        "depth": drive.depth_m,
        "disparity": 40 / drive.depth_m,
        "flow": flow_px,
        "turn": drive.turn_deg,
        "blur": (2.9 if has["blur"] else 0.4) + 0.02 * flow_px,
        "noise": (5.0 if has["noise"] else 1.0) * np.sqrt(grey_dn / 110),
        "calibration": (0.5 if has["calibration"] else 0.01) * (1 + 0.2 / drive.depth_m),
        "light_jump": np.abs(np.diff(stops, prepend=stops[0])),
        "unlike_eyes": (1.0 if has["eyes"] else 0.02) * everywhere + 0.02 * rng.random(FRAMES),
        "missing_frames": (rng.random(FRAMES) < 0.15) * float(has["drops"]),
        "burnt": np.clip((grey_dn - 110) / 400, 0, None),
        "darkness": 1 / grey_dn,
        "short_steps": 1 / drive.step_m,
        "since_start": np.arange(FRAMES, dtype=float),
    }
    return DrawnCase(conditions, number, drive.step_m, grey_dn)


def triggers(weakness: str, case: DrawnCase, rng: Generator) -> Mask:
    """The frames (FRAMES,) in which an estimator with a weakness fails."""
    conditions = case.conditions
    time = np.arange(FRAMES) / FRAMES
    is_dark = case.grey_dn < DARK_DN
    is_faint = conditions["faintness"] > 9
    has_movers = conditions["moving"] > 0.08
    is_off = conditions["calibration"] > 0.35
    masks = {
        "dark": is_dark,
        "turn": conditions["turn"] > 5,
        "flow": conditions["flow"] > 30,
        "moving": has_movers,
        "jump": conditions["light_jump"] > 0.3,
        "faint": is_faint,
        "left eye": conditions["unlike_eyes"] > 0.5,
        "calibration": is_off,
        "far": conditions["disparity"] < 13,
        "dark and moving": is_dark & (conditions["moving"] > 0.03),
        "calibration or moving": is_off | has_movers,
        "faint or calibration": is_faint | is_off,
        "after N frames": time > 0.55,
        "clock": (time > 0.25) & (time < 0.46),
        "coin": rng.random(FRAMES) < 0.15,
        "bursts": _bursts(rng),
        "none": np.zeros(FRAMES, bool),
    }
    return masks[weakness]


def _bursts(rng: Generator) -> Mask:
    """Failures by chance that last four frames on average."""
    fails = np.zeros(FRAMES, bool)
    for frame in range(1, FRAMES):
        fails[frame] = rng.random() < (0.75 if fails[frame - 1] else 0.05)
    return fails


def attribute_weakness(weakness: str, seed: int, *, drives: int = 1, without: str = "") -> Attribution:
    """What `causes` says of an estimator with a weakness on twelve cases, without one of the conditions."""
    rng = np.random.default_rng([seed, list(TRUE_CONDITIONS).index(weakness)])
    drawn_drives = [draw_drive(rng) for _ in range(drives)]
    series = []
    for number in range(CASES):
        drive = number % drives
        case = draw_case(rng, drawn_drives[drive], drive)
        noise = np.abs(rng.normal(0, 0.01, FRAMES)) * np.sqrt(MEAN_STEP_M / case.step_m)
        loss = 0.002 + noise + triggers(weakness, case, rng) * FAULT_M / case.step_m
        loss[0] = 0.0
        conditions = {name: values for name, values in case.conditions.items() if name != without}
        series.append(
            ErrorSeries(f"case_{number}", 0, conditions, np.minimum(loss, 1.0), place="hall", drive=str(drive))
        )
    found = attribute(series)
    assert found is not None
    return found


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether what is named contains a true condition, and a row without one; and what is explained."""

    is_found: bool
    is_false: bool
    explained: float


def judge(weakness: str, found: Attribution) -> Verdict:
    """Compare the conditions that are named for raising the error with the true ones."""
    true = TRUE_CONDITIONS[weakness]
    raising = [cause for cause in found.named if cause.factor > 1]
    is_found = any(true & set(cause.conditions) for cause in raising)
    is_false = any(not true & set(cause.conditions) for cause in raising)
    return Verdict(is_found, is_false, found.explained)


def main() -> None:
    """Print, for each weakness, how often it is found and how often something false is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="the seed of the first draw")
    parser.add_argument("--drives", type=int, nargs="+", default=[1, 3])
    parser.add_argument("--without", default="", help="a condition that is left out")
    parser.add_argument("--only", nargs="*", help="some of the weaknesses")
    arguments = parser.parse_args()
    for drives in arguments.drives:
        for weakness in arguments.only or TRUE_CONDITIONS:
            verdicts = []
            for seed in range(arguments.first, arguments.first + arguments.draws):
                found = attribute_weakness(weakness, seed, drives=drives, without=arguments.without)
                verdicts.append(judge(weakness, found))
            found_count = sum(verdict.is_found for verdict in verdicts)
            false_count = sum(verdict.is_false for verdict in verdicts)
            explained = np.median([verdict.explained for verdict in verdicts])
            print(
                f"{drives} drives, {weakness:22} found {found_count:3}, false {false_count:3} of {arguments.draws}, "
                f"explained {explained:.0%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
