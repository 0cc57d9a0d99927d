"""What the file of a case states that a board needs: calibration group, scenario, and noise of the ground truth."""

import json
from collections.abc import Mapping
from typing import Any

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
        severity=severity if isinstance(severity, int) else None,
        place=_place(content),
        drive=_drive(content),
        truth_noise=_truth_noise(truth_noise),
        truth_noise_m=truth_noise.get("position_m", 0.0),
    )


def _place(content: Mapping[str, Any]) -> str:
    """The scene that a case takes place in, with its seed, whatever a scenario changes in it; empty if unknown."""
    scene = content.get("scene") or {}
    if not isinstance(scene, dict) or not scene.get("name"):
        return ""
    seed = scene.get("seed")
    return f"{scene['name']} {seed}" if seed else str(scene["name"])


def _drive(content: Mapping[str, Any]) -> str:
    """What determines the path of a case, as text; empty if unknown."""
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
