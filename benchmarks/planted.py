"""Cases built to fail for a known reason: whether `causes`, `explain` and `shrink` find it.

    python benchmarks/planted.py [--world held_out.yaml] [--errors | --causes | --shrink] [--only NAME ...]

A world is a small hall, some twenty frames at 240 × 160 pixels. Every case has a little of most things, and much of
one, or of two. `planted.yaml` is what the rules of `explain` and `causes` were made with, `held_out.yaml` is not.
Prints which cause was planted and which were found; with --errors only how much worse each case is for it.
"""

import argparse
import json
import shutil
import time
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from vobench.analysis.causes import attribute
from vobench.analysis.explain_trial import explain_trial
from vobench.analysis.shrink_trial import ShrunkTrial, failure_of, shrink_trial
from vobench.analysis.trial_data import read_conditions, read_error_series, read_outcome
from vobench.errors import InputError
from vobench.geometry import rig
from vobench.geometry.camera import Pinhole
from vobench.rendering import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.runner.executor import Serial
from vobench.runner.finished_trial import read_finished_trial, read_simulated_case
from vobench.runner.folder import RunFolder
from vobench.runner.key import cache_folder
from vobench.runner.plan_runner import PlanRunner
from vobench.runner.run import run_suite
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan

SHRUNK_SHARE = 0.25  # of the frames, that a failure should shrink to
LENS = Pinhole(240, 160, 200.0, 200.0, 119.5, 79.5)


@dataclass(frozen=True)
class World:
    """A scene, a suite of one case in it, and what can be planted."""

    scene: dict[str, Any]
    suite: dict[str, Any]
    planted: dict[str, dict[str, Any]]
    pairs: list[list[str]]
    drive: dict[str, Any]
    failures: dict[str, dict[str, Any]]

    def write(self, folder: Path, name: str, changes: Sequence[Mapping[str, Any]], estimators: Sequence[str]) -> Path:
        """The suite of one case, in a folder of its own, with these changes."""
        scene = deepcopy(self.scene)
        suite = deepcopy(self.suite)
        for change in changes:
            scene = changed(scene, change.get("scene", {}))
            suite["rigs"]["ahead"] |= change.get("rig", {})
            suite["cameras"]["usual"] |= change.get("camera", {})
            suite["trajectories"] |= change.get("trajectories", {})
        place = folder / name
        place.mkdir(parents=True, exist_ok=True)
        (place / f"{scene['name']}.yaml").write_text(as_yaml(scene))
        suite |= {"name": name, "scenes": [scene["name"]], "estimators": list(estimators)}
        (place / "suite.yaml").write_text(as_yaml(suite))
        return place / "suite.yaml"


def read_world(path: Path) -> World:
    """The world in a YAML file."""
    return World(**YAML(typ="safe").load(path))


def as_yaml(tree: Any) -> str:
    """A tree as text that YAML reads, without references between its parts."""
    return json.dumps(tree, indent=1)


def small_lens() -> None:
    """A lens that is drawn in milliseconds, beside those that rigs may name."""
    rig.PRESETS["small"] = replace(rig.PRESETS["paper_blender"], left=LENS, right=LENS)


def coarse_light() -> None:
    """Light that is computed in half a second: no two cases here differ by how finely it is."""
    whole = bake.bake
    bake.bake = lambda scene, _, tell: whole(scene, BakeSettings(0.1, 4, 0.3, 64, 4), tell)


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


def run(suite: Path, out: Path) -> RunFolder:
    """The suite, run in this process, which alone knows the small lens."""
    return plan_runner(out)(read_plan(str(suite)))


def plan_runner(out: Path) -> PlanRunner:
    """Runs a plan in this process."""

    def run_here(plan: Plan, /) -> RunFolder:
        return run_suite(plan, {}, root=out, store=cache_folder(), finish=lambda *_: None, executor=Serial())

    return run_here


def named(world: World, names: Sequence[str]) -> tuple[list[dict[str, Any]], str]:
    """The changes that plant these, and the estimator that fails for the last."""
    changes = [world.planted[name] for name in names]
    return changes, changes[-1]["estimator"] if changes else ""


def print_errors(world: World, out: Path, chosen: Sequence[Sequence[str]]) -> None:
    """Of each case the error with what is planted, without any, and of two with each alone."""
    for names in chosen:
        _, estimator = named(world, names)
        told = []
        for planted in ((), *([name] for name in names), *([names] if len(names) > 1 else [])):
            folder = run(world.write(out, "_".join([*planted, estimator]), named(world, planted)[0], [estimator]), out)
            (score,) = folder.scores()
            loss = read_outcome(folder, score).loss.mean()
            told.append(f"{'+'.join(planted) or 'nothing'} {loss:.1%} ({score.status}, {score.frames} frames)")
        print(f"{'+'.join(names):20} {estimator:12} {'; '.join(told)}", flush=True)


def explain_all(world: World, out: Path, chosen: Sequence[Sequence[str]], repeats: int) -> int:
    """Print what `explain` names of each; how many it names rightly."""
    right = 0
    for planted in chosen:
        changes, estimator = named(world, planted)
        wanted = {change["cause"] for change in changes}
        folder = run(world.write(out, "_".join([*planted, estimator]), changes, [estimator]), out)
        (score,) = folder.scores()
        trial = folder.path / score.case / score.estimator
        began = time.process_time()
        found = explain_trial(trial, run_plan=plan_runner(out), repeats=repeats).explanation
        ranked = [*found.singles[:3], *found.pairs[:2]]
        told = ", ".join(f"{'+'.join(c.removed)} {c.reduction:.0%} [{c.low:.0%}, {c.high:.0%}]" for c in ranked)
        right += (is_right := wanted == set(found.named).union(*found.alternatives))
        everything = "none" if found.everything is None else f"{found.everything.reduction:.0%}"
        print(
            f"{'+'.join(planted):20} {estimator:12} {score.status:8} {found.loss:6.1%} "
            f"{'right' if is_right else 'WRONG'}: {found.relation}: {' and '.join(found.named)}; {told}; "
            f"all {everything}; {found.trials} trials, {time.process_time() - began:.0f} s",
            flush=True,
        )
    return right


def shrink_all(world: World, out: Path, chosen: Sequence[str]) -> int:
    """Print to how much each failure shrinks; how many to a quarter within twelve trials, and fail alike elsewhere.

    A name is one of the world's failures, or of what is planted, which then makes an estimator inaccurate on the long
    drive.
    """
    right = 0
    for name in chosen:
        failure = world.failures.get(name) or world.planted[name]
        estimator = failure["estimator"]
        folder = run(world.write(out, f"long_{name}", [{"trajectories": world.drive}, failure], [estimator]), out)
        (score,) = folder.scores()
        trial = folder.path / score.case / score.estimator
        began_s = time.process_time()
        try:
            found = shrink_trial(trial, run_plan=plan_runner(out), trials=12, folder=out / f"small_{name}")
        except InputError as error:
            print(f"{name:24} {estimator:12} WRONG: {error}", flush=True)
            continue
        is_alike = fails_alike_elsewhere(found, trial, out / "elsewhere" / name)
        first, end = found.found.window
        share = (end - first) / found.frame_count
        is_right = share <= SHRUNK_SHARE and is_alike
        right += is_right
        print(
            f"{name:24} {estimator:12} {'right' if is_right else 'WRONG'}: {found.summary}, {found.frame_count} frames "
            f"to {end - first} ({share:.0%}), {len(found.found.tried)} trials, without "
            f"{', '.join(found.found.removed) or 'nothing'}, {'alike' if is_alike else 'not alike'} elsewhere; "
            f"{time.process_time() - began_s:.0f} s",
            flush=True,
        )
    return right


def fails_alike_elsewhere(found: ShrunkTrial, trial: Path, folder: Path) -> bool:
    """Whether the saved suite, copied to another folder, fails in the same way."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(found.suite.parent, folder)
    again = run(folder / found.suite.name, folder / "runs")
    (score,) = again.scores()
    return failure_of(read_finished_trial(trial)).is_in(again, score)


def rank_causes(world: World, out: Path) -> int:
    """Print which conditions `causes` ranks first for each planted thing, of its estimator on all cases."""
    names = ("usual", *world.planted)
    right = 0
    estimators = tuple(dict.fromkeys(change["estimator"] for change in world.planted.values()))
    folders = {
        name: run(world.write(out, f"all_{name}", [world.planted.get(name, {})], estimators), out) for name in names
    }
    seen = {name: read_conditions(folder, read_simulated_case(folder, "way")) for name, folder in folders.items()}
    for estimator in estimators:
        scores = {name: next(s for s in f.scores() if s.estimator == estimator) for name, f in folders.items()}
        found = attribute(
            [replace(read_error_series(folders[name], scores[name], seen[name]), case=name) for name in names]
        )
        assert found is not None
        for name, change in world.planted.items():
            if change["estimator"] == estimator:
                ranked = found.cases[name]
                firsts = {condition for cause, _ in ranked[:2] for condition in cause.conditions}
                right += (is_right := bool(firsts & SHOWN[change["cause"]]))
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
    "low light": {"darkness", "black", "noise"},
    "burnt pixels": {"burnt"},
    "low texture": {"faintness"},
    "unlike eyes": {"unlike_eyes"},
    "dropped frames": {"missing_frames"},
}


def main() -> None:
    """Read what is asked for, and print."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--world", type=Path, default=Path(__file__).with_name("planted.yaml"))
    asked.add_argument("--out", type=Path, default=Path("runs/planted"))
    asked.add_argument("--repeats", type=int, default=2)
    asked.add_argument("--only", nargs="*", help="planted things, and pairs as a+b; with --shrink failures")
    what = asked.add_mutually_exclusive_group()
    what.add_argument("--errors", action="store_true", help="only how wrong each case is, with and without")
    what.add_argument("--causes", action="store_true", help="rank conditions over all instead")
    what.add_argument("--shrink", action="store_true", help="shrink longer failures instead")
    args = asked.parse_args()
    small_lens()
    coarse_light()
    world = read_world(args.world)
    out = args.out / world.scene["name"]
    chosen = (
        [name.split("+") for name in args.only] if args.only else [*([name] for name in world.planted), *world.pairs]
    )
    if args.errors:
        print_errors(world, out, chosen)
    elif args.causes:
        print(f"{rank_causes(world, out)} of {len(world.planted)} in the first two")
    elif args.shrink:
        names = args.only or list(world.failures)
        print(f"{shrink_all(world, out, names)} of {len(names)} shrunk to a quarter, and fail alike elsewhere")
    else:
        print(f"{explain_all(world, out, chosen, args.repeats)} of {len(chosen)} right")


if __name__ == "__main__":
    main()
