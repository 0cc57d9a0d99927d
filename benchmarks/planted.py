"""Cases built to fail for a known reason: whether `causes` and `explain` find it.

    python benchmarks/planted.py [--out FOLDER] [--repeats 2] [--only NAME ...]

A small hall, 240 × 160 pixels, some twenty frames. Every case has a little of most things, and much of one, or of two.
Prints which cause was planted and which were found.
"""

import argparse
import time
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from vobench.analysis.causes import attribute
from vobench.cli.failure import conditions_of, course, explained, read_simulated, read_trial, shrunk
from vobench.geometry import rig
from vobench.geometry.camera import Pinhole
from vobench.render import bake
from vobench.run.executor import Serial
from vobench.run.folder import RunFolder
from vobench.run.key import cache_folder
from vobench.run.run import run_suite
from vobench.suite.suite import read_plan

LENS = Pinhole(240, 160, 200.0, 200.0, 119.5, 79.5)

HALL = yaml.safe_load("""
name: hall
white_cd_m2: 60
materials:
  floor: {pattern: terrazzo, albedo: 0.45, contrast: 0.5, resolution_px: 256}
  wall: {pattern: poster, albedo: 0.5, contrast: 0.5, resolution_px: 256, tile_m: 2}
  box: {pattern: poster, albedo: 0.4, contrast: 0.6, resolution_px: 256, seed: 3}
  looking_glass: {kind: mirror, tint: 0.9}
room: {size_m: [6, 5, 2.6], floor: floor, wall: wall, ceiling: wall}
boxes:
  - {center_m: [2.2, 1.0, 0.4], size_m: [0.6, 0.6, 0.8], material: box}
  - {center_m: [2.0, -1.2, 0.3], size_m: [0.5, 0.7, 0.6], material: box, yaw_deg: 30}
lamps:
  - {name: lamp, center_m: [0.5, 0.5, 2.5], size_m: [0.8, 0.5], power_lm: 3000,
     level: {flicker: {depth: 0.1, mains_hz: 48.7}}}
  - {name: far, center_m: [-1.5, -1.0, 2.5], size_m: [0.3, 0.3], power_lm: 1500}
""")
SUITE = yaml.safe_load("""
name: planted
seed: 1
scenes: [hall]
rigs:
  ahead: {lens: small, pitch_deg: 12, calibration_error: {right_yaw_deg: 0.01, right_roll_deg: 0.02}}
trajectories: {way: {targets_m: [[1.0, 0.4]], controller: smooth, rate_hz: 5}}
cameras:
  usual: {sensor: mt9v034, exposure_ms: 5, blur_sigma_px: 0.3, vignetting: 0.2}
""")
CROWD = [
    {
        "name": f"walker_{n}",
        "size_m": [0.3, 0.7, 1.7],
        "material": "box",
        "path": [{"t_s": 0, "position_m": [x, y, 0.85]}, {"t_s": 4, "position_m": [x, y + 2.0, 0.85]}],
    }
    for n, (x, y) in enumerate(((1.75, -1.9), (1.75, -1.0), (1.75, -0.1), (2.4, -2.3), (2.4, -1.4), (2.4, -0.5)))
]
# Its name among the nuisances, an estimator that it makes fail, and what is changed.
PLANTED: dict[str, tuple[str, str, dict[str, Any]]] = {
    "flicker": (
        "changing light",
        "lk_epipolar",
        {
            "scene": {
                "lamps.0.level": {"flicker": {"depth": 1.0, "mains_hz": 48.7}},
                "lamps.1.level": {"flicker": {"depth": 1.0, "mains_hz": 48.7}},
            },
            "camera": {"exposure_ms": 0.5},
        },
    ),
    "mirror": ("mirrors", "planar_floor", {"scene": {"room.floor": "looking_glass"}}),
    "gloss": (
        "gloss",
        "planar_floor",
        {
            "scene": {
                "materials.floor": {
                    **HALL["materials"]["floor"],
                    "kind": "polished",
                    "tint": 1.0,
                    "eta": 4.0,
                    "contrast": 0.3,
                }
            }
        },
    ),
    "blur": ("blur", "lk_epipolar", {"camera": {"blur_sigma_px": 6.0}}),
    "noise": ("noise", "lk_epipolar", {"camera": {"gain_db": 30, "exposure_gain": 0.03, "chip": {"read_noise_e": 60}}}),
    "rolling": (
        "rolling shutter",
        "feature_vo",
        {"camera": {"shutter": "rolling", "readout_ms": 190}, "scene": {"lamps.0.level": {"steady": 1.0}}},
    ),
    "calibration": (
        "calibration",
        "lk_epipolar",
        {"rig": {"calibration_error": {"right_yaw_deg": 1.0, "right_roll_deg": 1.0}}},
    ),
    "crowd": ("moving things", "feature_vo", {"scene": {"movers": CROWD}}),
    "burnt": ("burnt pixels", "lk_epipolar", {"camera": {"exposure_gain": 12.0}}),
    "texture": (
        "low texture",
        "lk_epipolar",
        {"scene": {"materials.floor.contrast": 0.01, "materials.wall.contrast": 0.01, "materials.box.contrast": 0.01}},
    ),
}
PLANTED |= {
    "eyes": ("unlike eyes", "stereo_pnp", {"camera": {"unlike": {"right": {"gain": 0.15, "blur_sigma_px": 4.0}}}}),
    "drops": ("dropped frames", "lk_epipolar", {"camera": {"timing": {"drop_share": 0.7, "drop_burst": 4}}}),
}
PAIRS = (
    ("blur", "crowd"),
    ("noise", "rolling"),
    ("burnt", "calibration"),
    ("mirror", "texture"),
    ("flicker", "calibration"),
)


def small_lens() -> None:
    """A lens that is drawn in milliseconds, beside those that rigs may name."""
    rig.PRESETS["small"] = replace(rig.PRESETS["paper_blender"], left=LENS, right=LENS)


def coarse_light() -> None:
    """Light that is computed in half a second: no two cases here differ by how finely it is."""
    whole = bake.bake
    bake.bake = lambda scene, _, tell: whole(scene, bake.BakeSettings(0.1, 4, 0.3, 64, 4), tell)


def changed(tree: Any, changes: Mapping[str, Any]) -> Any:
    """A tree with values at keys with dots between."""
    tree = deepcopy(tree)
    for keys, value in changes.items():
        *way, last = (int(key) if key.isdigit() else key for key in keys.split("."))
        place = tree
        for key in way:
            place = place[key]
        place[last] = value
    return tree


def write(folder: Path, name: str, planted: tuple[str, ...], estimators: tuple[str, ...]) -> Path:
    """The suite of one case, in a folder of its own, with these things planted."""
    scene, suite = deepcopy(HALL), deepcopy(SUITE)
    for each in planted:
        change = PLANTED[each][2]
        scene = changed(scene, change.get("scene", {}))
        suite["rigs"]["ahead"] |= change.get("rig", {})
        suite["cameras"]["usual"] |= change.get("camera", {})
        suite |= change.get("suite", {})
    place = folder / name
    place.mkdir(parents=True, exist_ok=True)
    (place / "hall.yaml").write_text(yaml.safe_dump(scene))
    (place / "suite.yaml").write_text(yaml.safe_dump({**suite, "name": name, "estimators": list(estimators)}))
    return place / "suite.yaml"


def run(suite: Path, out: Path) -> RunFolder:
    """The suite, run in this process, which alone knows the small lens."""
    return run_suite(
        read_plan(str(suite)), {}, root=out, store=cache_folder(), finish=lambda *_: None, executor=Serial()
    )


def explain_all(out: Path, chosen: list[tuple[str, ...]], repeats: int) -> int:
    """Print what `explain` names of each; how many it names rightly."""
    right = 0
    for planted in chosen:
        wanted, estimator = {PLANTED[each][0] for each in planted}, PLANTED[planted[-1]][1]
        folder = run(write(out, "_".join(planted), planted, (estimator,)), out)
        (score,) = folder.scores()
        tried = read_trial(folder.path / score.case / score.estimator)
        began = time.process_time()
        found = explained(tried, repeats=repeats, out=out, jobs=1)
        ranked = [*found.singles[:3], *found.pairs[:2]]
        told = ", ".join(f"{'+'.join(c.removed)} {c.mended:.0%} [{c.low:.0%}, {c.high:.0%}]" for c in ranked)
        right += (is_right := wanted == set(found.named))
        print(
            f"{'+'.join(planted):20} {estimator:12} {score.status:8} {found.loss:6.1%} "
            f"{'right' if is_right else 'WRONG'}: {' and '.join(found.named) or 'none'}; {told}; all "
            f"{found.everything.mended:.0%}; {time.process_time() - began:.0f} s",
            flush=True,
        )
    return right


# Failures of a longer drive: an estimator, and what is changed.
LONG = {
    "trajectories": {
        "way": {"targets_m": [[1.0, 0.4], [0.3, -0.5], [1.1, -0.2]], "controller": "smooth", "rate_hz": 30}
    }
}
OFF = {"switched": {"times_s": [6.0]}}
GAP = {"switched": {"times_s": [5.0, 5.6]}}
FAILURES: dict[str, tuple[str, dict[str, Any]]] = {
    "lights go out": ("lk_epipolar", {"scene": {"lamps.0.level": OFF, "lamps.1.level": OFF}}),
    "lights fail for a while": ("lk_epipolar", {"scene": {"lamps.0.level": GAP, "lamps.1.level": GAP}}),
    "noise": ("lk_epipolar", PLANTED["noise"][2]),
    "texture": ("lk_epipolar", PLANTED["texture"][2]),
    "blur": ("feature_vo", PLANTED["blur"][2]),
}


def shrink_all(out: Path, chosen: list[str]) -> int:
    """Print to how much each failure shrinks; how many to a fifth within twelve trials."""
    right = 0
    for name in chosen:
        estimator, change = FAILURES[name]
        place = name.replace(" ", "_")
        PLANTED[place] = ("", estimator, {**change, "suite": LONG})
        folder = run(write(out, f"long_{place}", (place,), (estimator,)), out)
        (score,) = folder.scores()
        began = time.process_time()
        found = shrunk(read_trial(folder.path / score.case / score.estimator), trials=12, out=out, jobs=1)
        first, end = found.case.frames or (0, score.frames)
        share = (end - first) / score.frames
        right += (is_right := share <= 0.2 and len(found.tried) <= 12)
        print(
            f"{name:24} {'right' if is_right else 'WRONG'}: {score.status} ({score.reason}), {score.frames} frames to "
            f"{end - first} ({share:.0%}), {len(found.tried)} trials, without {', '.join(found.removed) or 'nothing'}; "
            f"{time.process_time() - began:.0f} s",
            flush=True,
        )
    return right


def rank_causes(out: Path) -> int:
    """Print which conditions `causes` ranks first for each planted thing, of its estimator on all cases."""
    names, right = ("usual", *PLANTED), 0
    estimators = tuple(dict.fromkeys(estimator for _, estimator, _ in PLANTED.values()))
    folders = {
        name: run(write(out, f"all_{name}", (name,) if name in PLANTED else (), estimators), out) for name in names
    }
    seen = {name: conditions_of(folder, read_simulated(folder, "way")) for name, folder in folders.items()}
    for estimator in estimators:
        scores = {name: next(s for s in f.scores() if s.estimator == estimator) for name, f in folders.items()}
        found = attribute([replace(course(folders[name], scores[name], seen[name]), case=name) for name in names])
        assert found is not None
        for name, (nuisance, its, _) in PLANTED.items():
            if its == estimator:
                ranked = found.cases[name]
                firsts = {condition for cause, _ in ranked[:2] for condition in cause.conditions}
                right += (is_right := bool(firsts & SHOWN[nuisance]))
                told = ", ".join(f"{'+'.join(c.conditions)} ×{factor:.2g}" for c, factor in ranked[:3])
                print(f"{name:12} {estimator:12} {'right' if is_right else 'WRONG'}: {told}", flush=True)
    return right


# By which conditions a nuisance shows.
SHOWN = {
    "changing light": {"light_jump", "black"},
    "mirrors": {"mirror"},
    "gloss": {"gloss"},
    "blur": {"blur"},
    "noise": {"noise"},
    "rolling shutter": {"rolling"},
    "calibration": {"calibration"},
    "moving things": {"moving"},
    "burnt pixels": {"burnt"},
    "low texture": {"faintness"},
    "unlike eyes": {"unlike_eyes"},
    "dropped frames": {"missing_frames"},
}


def main() -> None:
    """Read what is asked for, and print."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--out", type=Path, default=Path("runs/planted"))
    asked.add_argument("--repeats", type=int, default=2)
    asked.add_argument("--only", nargs="*", help="planted things, and pairs as a+b")
    asked.add_argument("--causes", action="store_true", help="rank conditions over all instead")
    asked.add_argument("--shrink", action="store_true", help="shrink longer failures instead")
    args = asked.parse_args()
    small_lens()
    coarse_light()
    if args.causes:
        print(f"{rank_causes(args.out)} of {len(PLANTED)} in the first two")
        return
    if args.shrink:
        names = args.only or list(FAILURES)
        print(f"{shrink_all(args.out, names)} of {len(names)} shrunk to a fifth")
        return
    chosen = [tuple(name.split("+")) for name in args.only or [*PLANTED, *("+".join(pair) for pair in PAIRS)]]
    print(f"{explain_all(args.out, chosen, args.repeats)} of {len(chosen)} right")


if __name__ == "__main__":
    main()
