"""One simulated case of a suite: the scene, lighting, rig, trajectory and camera of one sequence."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry.rig import Rig, drawn_calibration_error, true_rig
from vobench.motion.wheeled import Wheeled
from vobench.scene.scene import Scene
from vobench.sensor.image_sensor import CameraSettings
from vobench.suite.axis import RigSettings
from vobench.suite.scene_lighting import Lighting
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite_spec import EXACT, Rendering, TruthNoise, Window
from vobench.suite.trajectory import TrajectorySpec

AXES = ("scene", "lighting", "rig", "trajectory", "camera")
CALIBRATION_STREAM = 7_301  # separates random calibration errors from the other random streams of a seed


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One sequence to simulate, and everything that it depends on.

    `variant` is the case's name on each of AXES. `name` joins those names that differ within the suite, so it is
    unique there and can name a folder. `seed` is the suite's. `replayed` is the content of the trajectory's file, as
    TUM text, if it has one. `scenario` and `severity` are set for cases of a scenario.
    """

    name: str
    variant: dict[str, str]
    scene: SceneFile
    lighting: Lighting
    rig: RigSettings
    trajectory: TrajectorySpec
    replayed: str | None = None
    camera: CameraSettings
    rendering: Rendering
    truth: tuple[str, ...]
    truth_noise: TruthNoise = EXACT
    frames: Window | None = None
    seed: int
    scenario: str | None = None
    severity: int | None = None

    def build_scene(self) -> Scene:
        """The scene under this case's lighting."""
        from vobench.suite.scene_build import build

        return build(self.scene, self.lighting)

    def build_rig(self) -> Rig:
        """The sensors with their nominal calibration, which estimators receive."""
        wheels = self.trajectory.wheels if isinstance(self.trajectory, Wheeled) else None
        return replace(self.rig.build(), wheels=wheels)

    def build_true_rig(self) -> Rig:
        """The stereo pair with its true calibration, which images are rendered with.

        Raises VobenchError, as `true_rig` does.
        """
        rig = self.build_rig()
        rng = np.random.default_rng([self.seed, CALIBRATION_STREAM])
        return true_rig(rig, drawn_calibration_error(self.rig.calibration_error, rig, rng))
