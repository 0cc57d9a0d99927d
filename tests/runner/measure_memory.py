"""For each suite: frames, and this process's peak memory in MB while its first case is simulated, and estimated.

The renderer is a plain one, so that a long sequence takes seconds: it holds nothing from frame to frame.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from vobench.rendering import raster
from vobench.runner.task import estimate_task, estimator_code, perform, sequence_tasks
from vobench.sequence import Sequence
from vobench.suite.suite import read_plan


class Plain:
    """Draws a slope of brightness that moves with the camera."""

    def __init__(self, baked: object, *, samples: int) -> None:
        pass

    def radiance(self, camera: Any, views: Any, **_: Any) -> Any:
        x_m = views[0].T_world_camera[0, 0, 3]
        slope = np.linspace(5, 45, camera.width_px, dtype=np.float32) + np.float32(20 * x_m)
        return np.repeat(slope[None], camera.height_px, 0)

    def close(self) -> None:
        pass


def forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def peak_mb() -> float:
    status = Path("/proc/self/status").read_text()
    return int(status.partition("VmHWM:")[2].split()[0]) / 1024


raster.RasterRenderer = Plain
store = Path(sys.argv[1])
for suite in sys.argv[2:]:
    plan = read_plan(suite)
    case = plan.simulated[0]
    forget_peak()
    for task in sequence_tasks(case):
        sequence = perform(task, store)
    simulating = peak_mb()
    forget_peak()
    for trial in plan.trials(case):
        perform(estimate_task(trial, task.key, estimator_code(trial.estimator_entry)), store)
    print(len(Sequence.open(sequence)), simulating, peak_mb())
