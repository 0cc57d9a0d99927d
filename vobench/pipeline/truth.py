"""What is true of every pixel that a case's cameras see: where each row of them stands, at which instant."""

import numpy as np

from vobench.geometry.rig import Side
from vobench.render.stand import Shot
from vobench.render.truth import TruthCaster
from vobench.scene.scene import Scene
from vobench.sensor.shutter import ShutterKind, row_stamps
from vobench.sensor.truth import TruthFrame, TruthNames
from vobench.suite.expand import Case
from vobench.trajectory.kinematics import Motion


class PixelTruth:
    """Ground truth of a case's pictures, amid each row's exposure; the true rig sees it."""

    def __init__(self, case: Case, scene: Scene, motion: Motion) -> None:
        self._rig, self._shutter, self._motion = case.build_true_rig(), case.camera.build_shutter(), motion
        self._channels, self._caster = case.truth, TruthCaster(scene)

    @property
    def names(self) -> TruthNames:
        """What ids stand for."""
        return self._caster.names

    def frame(self, side: Side, t_ns: int, next_t_ns: int | None) -> TruthFrame:
        """The channels of the picture stamped t_ns; the one stamped next_t_ns is where flow leads."""
        later = None if next_t_ns is None else self._shot(side, next_t_ns)
        return self._caster.frame(self._rig.camera(side), self._shot(side, t_ns), self._channels, later=later)

    def _shot(self, side: Side, t_ns: int) -> Shot:
        T_body_camera = self._rig.T_body_camera(side)
        if self._shutter.kind is ShutterKind.GLOBAL:
            return Shot(self._motion.at(np.array([t_ns])).T_world_body[0] @ T_body_camera, t_ns)
        stamps = row_stamps(self._rig.camera(side).height_px, self._shutter, t_ns)
        return Shot(self._motion.at(stamps).T_world_body @ T_body_camera, stamps)
