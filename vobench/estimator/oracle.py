"""`noisy_truth`: the truth with noise of a stated level, which the harness itself draws; no plugin is run."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vobench.estimator.program import Answer, EstimatorFailure
from vobench.estimator.protocol import Frame, Result, Status
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Trajectory


class NoisyTruth:
    """True poses of the left camera with independent noise of the deviations `position_m` and `rotation_rad`.

    It states the covariance of that noise, times `stated`.
    """

    def __init__(self, gt: Trajectory) -> None:
        T_odom_left = se3.inverse(gt.T_world_frame[:1]) @ gt.T_world_frame
        self._T_odom_left = dict(zip(gt.t_ns.tolist(), T_odom_left, strict=True))

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Take the level of noise."""
        del rig
        self._sigma = np.repeat([params["position_m"], params["rotation_rad"]], 3)
        self._stated = params["stated"]
        self._rng = np.random.default_rng([seed, 20260101])
        if not ((self._sigma > 0).all() and self._stated > 0):
            raise EstimatorFailure("refused", "position_m, rotation_rad and stated should be more than 0")

    def process(self, frame: Frame) -> Answer:
        """The true pose at a frame, moved and turned by noise about the axes of odom."""
        e = self._rng.normal(size=6) * self._sigma
        T = self._T_odom_left.get(frame.t_ns)
        if T is None:
            return Answer(Result(None, Status.LOST, "no truth"), 0.0, 0.0)
        half_rad = np.linalg.norm(e[3:]) / 2
        R = se3.from_quaternion([*(np.sinc(half_rad / np.pi) * e[3:] / 2), np.cos(half_rad)]) @ T[:3, :3]
        P = np.diag(self._stated * self._sigma**2)
        return Answer(Result(se3.transform(R, T[:3, 3] + e[:3]), covariance=P), 0.0, 0.0)

    def finish(self) -> dict[int, Array]:
        """Nothing to revise."""
        return {}

    def __enter__(self) -> "NoisyTruth":
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to end."""
