"""A case as a suite of its own: a folder that `vobench run` takes wherever it is copied to."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from typing import Any

from ruamel.yaml import YAML

from vobench.motion.replay import Replay
from vobench.suite.suite import AXES, Case, Entrant
from vobench.suite.yaml_file import plain, without_nothing

SUITE_FILE = "suite.yaml"
POSES_FILE = "poses.tum"


def write_case(case: Case, entrants: Sequence[Entrant], folder: Path, *, name: str, summary: str = "") -> Path:
    """Write the suite of one case, with its scene, models and recorded poses beside it; the suite's file.

    Estimators keep their names, for a folder of that name may be put beside it; those found by a path, their path.
    """
    folder.mkdir(parents=True, exist_ok=True)
    of = {axis: case.variant.get(axis, "it") for axis in AXES}
    scene = case.variant.get("scene", case.scene.name)
    _write(folder / f"{scene}.yaml", _scene(case, folder))
    suite = {
        "name": name,
        "summary": summary,
        "seed": case.seed,
        "scenes": [scene],
        "lightings": {of["lighting"]: without_nothing(plain(case)["lighting"])},
        "rigs": {of["rig"]: without_nothing(plain(case.rig))},
        "trajectories": {of["trajectory"]: _trajectory(case, folder)},
        "cameras": {of["camera"]: without_nothing(plain(case.camera))},
        "rendering": without_nothing(plain(case.rendering)),
        "truth": list(case.truth),
        "truth_noise": plain(case.truth_noise),
        **({"frames": list(case.frames)} if case.frames else {}),
        "estimators": [_estimator(entrant) for entrant in entrants],
    }
    _write(folder / SUITE_FILE, suite)
    return folder / SUITE_FILE


def _scene(case: Case, folder: Path) -> Any:
    said = without_nothing(plain(case.scene))
    for part in (*said.get("meshes", ()), *said.get("movers", ()), said):
        for key in ("file", "maker"):
            if part.get(key):
                source = Path(part[key])
                copyfile(source, folder / source.name)
                part[key] = source.name
    return said


def _trajectory(case: Case, folder: Path) -> Any:
    """With its poses in a file of their own, in our axes and stamped, where it replays some."""
    spec = case.trajectory
    if isinstance(spec, Replay) and case.replayed is not None:
        (folder / POSES_FILE).write_text(case.replayed, encoding="utf-8")
        spec = replace(spec, file=POSES_FILE, times=None, recorded_hz=None, axes="body")
    return without_nothing(
        {key: value for key, value in plain(case)["trajectory"].items() if hasattr(spec, key)} | _moved(spec)
    )


def _moved(spec: Any) -> dict[str, Any]:
    return {key: getattr(spec, key) for key in ("file", "times", "recorded_hz", "axes") if isinstance(spec, Replay)}


def _estimator(entrant: Entrant) -> Any:
    limits = {
        key: value for key, value in plain(entrant.limits).items() if value != getattr(entrant.manifest.limits, key)
    }
    return without_nothing(
        {"name": entrant.manifest.name, "label": entrant.label, "params": entrant.params, "limits": limits}
    )


def _write(path: Path, tree: Any) -> None:
    yaml = YAML()
    yaml.width = 120
    yaml.default_flow_style = None
    with path.open("w", encoding="utf-8") as file:
        yaml.dump(tree, file)
