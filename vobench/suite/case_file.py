"""Writes a case as a suite of its own: a folder that `vobench run` accepts wherever it is copied to."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from typing import Any

from ruamel.yaml import YAML

from vobench.motion.replay import Replay
from vobench.suite.case import AXES, Case
from vobench.suite.entrant import EstimatorEntry
from vobench.suite.yaml_file import plain
from vobench.suite.yaml_source import without_nothing

SUITE_FILE = "suite.yaml"
POSES_FILE = "poses.tum"
UNNAMED = "it"  # the variant on an axis where the case has no name
REPLAY_SOURCE_KEYS = ("file", "times", "recorded_hz", "axes")  # of a replayed trajectory
LINE_WIDTH = 120


def write_case(case: Case, entrants: Sequence[EstimatorEntry], folder: Path, *, name: str, summary: str = "") -> Path:
    """Write the suite of one case with its scene, models and recorded poses; return the path of the suite's file.

    Estimators are written by name, so that a folder of that name can be put beside the suite.
    """
    folder.mkdir(parents=True, exist_ok=True)
    variant = {axis: case.variant.get(axis, UNNAMED) for axis in AXES}
    scene = case.variant.get("scene", case.scene.name)
    _write_yaml(folder / f"{scene}.yaml", _write_scene_files(case, folder))
    suite = {
        "name": name,
        "summary": summary,
        "seed": case.seed,
        "scenes": [scene],
        "lightings": {variant["lighting"]: without_nothing(plain(case)["lighting"])},
        "rigs": {variant["rig"]: without_nothing(plain(case.rig))},
        "trajectories": {variant["trajectory"]: _write_trajectory_file(case, folder)},
        "cameras": {variant["camera"]: without_nothing(plain(case.camera))},
        "rendering": without_nothing(plain(case.rendering)),
        "truth": list(case.truth),
        "truth_noise": plain(case.truth_noise),
    }
    if case.frames:
        suite["frames"] = list(case.frames)
    suite["estimators"] = [_estimator(entrant) for entrant in entrants]
    _write_yaml(folder / SUITE_FILE, suite)
    return folder / SUITE_FILE


def _write_scene_files(case: Case, folder: Path) -> Any:
    """Copy the files of the case's scene to a folder; return the scene's YAML, which names the copies."""
    scene = without_nothing(plain(case.scene))
    parts = (*scene.get("meshes", ()), *scene.get("movers", ()), scene)
    for part in parts:
        for key in ("file", "maker"):
            if part.get(key):
                source = Path(part[key])
                copyfile(source, folder / source.name)
                part[key] = source.name
    return scene


def _write_trajectory_file(case: Case, folder: Path) -> Any:
    """Write the replayed poses, if any, in body axes and with stamps; return the trajectory's YAML."""
    spec = case.trajectory
    if isinstance(spec, Replay) and case.replayed is not None:
        (folder / POSES_FILE).write_text(case.replayed, encoding="utf-8")
        spec = replace(spec, file=POSES_FILE, times=None, recorded_hz=None, axes="body")
    trajectory = {key: value for key, value in plain(case)["trajectory"].items() if hasattr(spec, key)}
    if isinstance(spec, Replay):
        trajectory |= {key: getattr(spec, key) for key in REPLAY_SOURCE_KEYS}
    return without_nothing(trajectory)


def _estimator(entrant: EstimatorEntry) -> Any:
    """The entry of an entrant in a suite, with those limits that are not its manifest's."""
    limits = dict[str, Any]()
    for key, value in plain(entrant.limits).items():
        if value != getattr(entrant.manifest.limits, key):
            limits[key] = value
    entry = {"name": entrant.manifest.name, "label": entrant.label, "params": entrant.params, "limits": limits}
    return without_nothing(entry)


def _write_yaml(path: Path, tree: Any) -> None:
    yaml = YAML()
    yaml.width = LINE_WIDTH
    yaml.default_flow_style = None
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(tree, file)
