"""What the file of a case states that a board needs: calibration group, scenario, and noise of the ground truth."""

import json
from collections.abc import Iterable, Mapping
from typing import Any

from vobench.errors import counted
from vobench.report.cell import CaseFacts
from vobench.report.json_file import read_object
from vobench.runner.folder import CASE, RunFolder

UNCALIBRATED = "none"  # the level of cases without a calibration error, such as recordings
MM_PER_M = 1e3


def case_facts(folder: RunFolder, case: str) -> CaseFacts:
    """The facts of a case; empty if its file is missing or states none."""
    content = read_object(folder.case(case) / CASE)
    rig = content.get("rig") or {}
    level = (rig.get("calibration_error") or {}).get("level")
    group = level if isinstance(level, str) and level != UNCALIBRATED else ""
    severity = content.get("severity")
    truth_noise = content.get("truth_noise") or {}
    return CaseFacts(
        group=group,
        scenario=str(content.get("scenario") or ""),
        severity=_whole_number(severity),
        place=_place(content),
        drive=_drive(content),
        place_seed=_place_seed(content),
        drive_seed=_drive_seed(content),
        lighting=_lighting(content),
        noise_seed=_whole_number(content.get("seed")),
        repeat_of=str(content.get("repeat_of") or ""),
        truth_noise=_truth_noise(truth_noise),
        truth_noise_m=truth_noise.get("position_m", 0.0),
    )


def design_remarks(facts: Iterable[CaseFacts], *, base_seed: int) -> list[str]:
    """One sentence on the units of a run whose places or drives were drawn by seeds; nothing for other runs."""
    drawn = [each for each in facts if each.place_seed is not None or each.drive_seed is not None]
    if not drawn:
        return []
    places = {each.place for each in drawn}
    units = {(each.place, each.drive) for each in drawn}
    counts = f"{counted(len(units), 'unit')} (a drive in a place) in {counted(len(places), 'place')}"
    return [f"The cases with seeds are in {counts}; the base seed is {base_seed}."]


def _place(content: Mapping[str, Any]) -> str:
    """The scene that a case takes place in, with its seed, whatever a scenario changes in it; empty if unknown."""
    scene = content.get("scene") or {}
    if not isinstance(scene, dict) or not scene.get("name"):
        return ""
    place_seed = _place_seed(content)
    if place_seed is not None:
        return f"{scene['name']}.{place_seed}"
    seed = scene.get("seed")
    return f"{scene['name']} {seed}" if seed else str(scene["name"])


def _place_seed(content: Mapping[str, Any]) -> int | None:
    """The seed of a generator's place; None for another scene."""
    generated = _section(_section(content, "scene"), "generated")
    return _whole_number(generated.get("seed"))


def _drive_seed(content: Mapping[str, Any]) -> int | None:
    """The seed of the drive of a body that wanders; None for another trajectory."""
    trajectory = _section(content, "trajectory")
    return _whole_number(trajectory.get("seed")) if trajectory.get("kind") == "wander" else None


def _lighting(content: Mapping[str, Any]) -> str:
    """The lighting of a generator's place, or the name of the suite's lighting; empty if unknown."""
    generated = _section(_section(content, "scene"), "generated")
    lighting = generated.get("lighting") or _section(content, "variant").get("lighting")
    return str(lighting or "")


def _section(content: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    section = content.get(key)
    return section if isinstance(section, dict) else {}


def _whole_number(value: Any) -> int | None:
    return value if isinstance(value, int) else None


def _drive(content: Mapping[str, Any]) -> str:
    """The settings that determine the path of a case, as text; empty if unknown."""
    trajectory = content.get("trajectory")
    if not trajectory:
        return ""
    return json.dumps([trajectory, content.get("replayed"), content.get("frames")], sort_keys=True)


def _truth_noise(noise: Mapping[str, float]) -> str:
    """The standard deviation of the ground truth's noise in words, empty if there is none."""
    position_mm = MM_PER_M * noise.get("position_m", 0)
    rotation_deg = noise.get("rotation_deg", 0)
    parts = []
    if position_mm:
        parts.append(f"{position_mm:g} mm per axis")
    if rotation_deg:
        parts.append(f"{rotation_deg:g}° per axis")
    return " and ".join(parts)
