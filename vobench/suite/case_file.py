"""Writes a single case as a suite, in a folder that can be copied and given to `vobench run`.

Only what differs from the defaults is written, so that a reader sees at once what is special about the case.
"""

from collections.abc import Sequence
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from pathlib import Path
from shutil import copyfile
from typing import Any

from ruamel.yaml import YAML

from vobench.motion.replay import Replay
from vobench.suite.axis import AXES
from vobench.suite.case import Case
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.yaml_file import plain
from vobench.suite.yaml_source import without_empty_keys

SUITE_FILE = "suite.yaml"
POSES_FILE = "poses.tum"
UNNAMED = "it"  # the name of a variant for which the case has no name
# How the written poses of a replayed trajectory are read: they have stamps and are those of the body.
WRITTEN_POSES: dict[str, Any] = {"file": POSES_FILE, "times": None, "recorded_hz": None, "axes": "body"}
KIND_KEY = "kind"  # says which settings follow, so it is written in any case
LINE_WIDTH = 120


def write_case(
    case: Case, estimator_entries: Sequence[EstimatorEntry], folder: Path, *, name: str, summary: str = ""
) -> Path:
    """Write the suite of one case with its scene, models and recorded poses, and return the path of the suite file.

    Estimators are written by name. They are found in a folder of that name beside the suite, or in the catalog.
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
        "lightings": {variant["lighting"]: without_empty_keys(plain(case)["lighting"])},
        "rigs": {variant["rig"]: special_settings(case.rig)},
        "trajectories": {variant["trajectory"]: _write_trajectory_file(case, folder)},
        "cameras": {variant["camera"]: special_settings(case.camera)},
    }
    optional = {
        "rendering": special_settings(case.rendering),
        "truth": list(case.truth),
        "truth_noise": special_settings(case.truth_noise),
        "frames": list(case.frames or ()),
    }
    suite |= {key: value for key, value in optional.items() if value}
    suite["estimators"] = [_estimator(estimator_entry) for estimator_entry in estimator_entries]
    _write_yaml(folder / SUITE_FILE, suite)
    return folder / SUITE_FILE


def _write_scene_files(case: Case, folder: Path) -> Any:
    """Copy the files of the case's scene to a folder, and return the content of the scene file with their new paths."""
    scene = special_settings(case.scene)
    parts = (*scene.get("meshes", ()), *scene.get("movers", ()), scene)
    for part in parts:
        for key in ("file", "maker", "generator"):
            if part.get(key):
                source = Path(part[key])
                copyfile(source, folder / source.name)
                part[key] = source.name
    return scene


def _write_trajectory_file(case: Case, folder: Path) -> Any:
    """Write the replayed poses, if any, and return the settings of the trajectory."""
    spec = case.trajectory
    # A trajectory by itself would have keys that belong to other kinds of movers, so the case is converted as a whole.
    settings = plain(case)["trajectory"]
    if isinstance(spec, Replay) and case.replayed is not None:
        (folder / POSES_FILE).write_text(case.replayed, encoding="utf-8")
        spec = replace(spec, **WRITTEN_POSES)
        settings = settings | WRITTEN_POSES
    return _special(spec, without_empty_keys(settings))


def special_settings(settings: Any) -> Any:
    """The settings that differ from the defaults, as plain values that read as the same settings again."""
    return _special(settings, without_empty_keys(plain(settings)))


def _special(settings: Any, tree: Any) -> Any:
    """The part of a tree of plain values that differs from the defaults of the settings that it stands for."""
    if is_dataclass(settings) and isinstance(tree, dict):
        return _special_fields(settings, tree)
    if isinstance(settings, dict) and isinstance(tree, dict):
        return {key: _special(settings.get(key), value) for key, value in tree.items()}
    if isinstance(settings, tuple) and isinstance(tree, list):
        return [_special(item, value) for item, value in zip(settings, tree, strict=True)]
    return tree


def _special_fields(settings: Any, tree: dict[str, Any]) -> dict[str, Any]:
    """The keys of a tree that differ from the defaults of the fields of a dataclass."""
    defaults = {field.name: _default(field) for field in fields(settings) if field.name != KIND_KEY}
    special = {}
    for key, value in tree.items():
        current = getattr(settings, key, None)
        is_default = key in defaults and current == defaults[key]
        if not is_default:
            special[key] = _special(current, value)
    return special


def _default(field: "Field[Any]") -> Any:
    """The default of a field; MISSING if it has none."""
    if field.default_factory is not MISSING:
        return field.default_factory()
    return field.default


def _estimator(estimator_entry: EstimatorEntry) -> Any:
    """An estimator as an entry of a suite, with the limits that differ from those of its manifest."""
    manifest = estimator_entry.manifest
    limits = dict[str, Any]()
    for key, value in plain(estimator_entry.limits).items():
        if value != getattr(manifest.limits, key):
            limits[key] = value
    entry: dict[str, Any] = {"name": manifest.name}
    if estimator_entry.label != manifest.name:
        entry["label"] = estimator_entry.label
    if estimator_entry.params != manifest.params:
        entry["params"] = estimator_entry.params
    if limits:
        entry["limits"] = limits
    return without_empty_keys(entry)


def _write_yaml(path: Path, tree: Any) -> None:
    yaml = YAML()
    yaml.width = LINE_WIDTH
    yaml.default_flow_style = None
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(tree, file)
