"""One simulated case of a suite: the scene, lighting, rig, trajectory and camera of one sequence."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry.rig import Rig, drawn_calibration_error, true_rig
from vobench.motion.wander import Wander
from vobench.motion.wheeled import Wheeled
from vobench.scene.scene import Scene
from vobench.sensor.image_sensor import CameraSettings
from vobench.suite.axis import RigSettings
from vobench.suite.scene_lighting import Lighting
from vobench.suite.scene_spec import SceneFile
from vobench.suite.suite_spec import EXACT, Rendering, TruthNoise, Window
from vobench.suite.trajectory import TrajectorySpec

REPEAT_SEED_STEP = 1_000_000  # between the seeds of two repeats; far above the seeds that users choose
CALIBRATION_STREAM = 7_301  # an arbitrary number that separates calibration errors from a seed's other random streams


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One sequence to simulate, with all settings that determine it.

    `name` is unique within the suite and valid as the name of a folder, for example office-dim. It consists of the
    names in `variant`, without those of the axes on which all cases of the suite are equal.
    `variant` maps each axis to the name of the scene, lighting, rig, trajectory or camera.
    `replayed` is the text of the replayed trajectory in TUM format, None for a trajectory that is generated.
    `truth` lists the channels of per-pixel ground truth to record, such as depth.
    `truth_noise` is the error that is added to the ground-truth trajectory; it is EXACT by default.
    `frames` (first, end) is the range of frames that the sequence contains, without `end`; None means all frames.
    `seed` is the seed of the suite.
    `scenario` and `severity` are set only for a case of a scenario.
    `repeat` counts the draws of noise from 0, and `repeat_of` is the name of the first one, None for that one itself.
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
    repeat: int = 0
    repeat_of: str | None = None

    def build_scene(self) -> Scene:
        """The scene with this case's lighting."""
        from vobench.suite.scene_build import build  # slow to import, and most commands build no scene

        return build(self.scene, self.lighting)

    def build_rig(self) -> Rig:
        """The sensors with the nominal calibration that estimators receive."""
        trajectory = self.trajectory
        wheels = trajectory.wheels if isinstance(trajectory, Wheeled | Wander) else None
        return replace(self.rig.build(), wheels=wheels)

    def build_true_rig(self) -> Rig:
        """The sensors with the true calibration that images are rendered with.

        Raises VobenchError if the calibration error needs a property that the cameras lack: `distortion_ratio` a lens
        with distortion, and `focal_ratio` or `center_px` a lens with a focal length.
        """
        nominal_rig = self.build_rig()
        rng = np.random.default_rng([self.seed, CALIBRATION_STREAM])
        error = drawn_calibration_error(self.rig.calibration_error, nominal_rig, rng)
        return true_rig(nominal_rig, error)


def with_repeats(cases: Iterable[Case], count: int) -> Iterator[Case]:
    """Each case `count` times, with different noise: of the sensors, of wheel slip, and of calibration errors.

    The first one is the case itself. The others have the same scene and trajectory and other seeds, and the number of
    the repeat is appended to their names, as in office-repeat2. On a board they are one cell for each estimator.
    """
    for case in cases:
        yield case
        for repeat in range(1, count):
            yield replace(
                case,
                name=f"{case.name}-repeat{repeat + 1}",
                seed=case.seed + repeat * REPEAT_SEED_STEP,
                repeat=repeat,
                repeat_of=case.name,
            )
