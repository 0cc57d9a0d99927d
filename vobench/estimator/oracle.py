"""The estimator `noisy_truth`: the ground truth with noise of a known level. It runs in vobench, not as a plugin."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from vobench.estimator.program import Answer, EstimatorFailure
from vobench.estimator.protocol import Frame, Result, Status
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.trajectory.trajectory import Trajectory

NOISE_STREAM = 20260101  # separates this noise from the other random streams of a seed


class NoisyTruth:
    """The true poses of the left camera with independent noise, whose level is given by standard deviations.

    The parameters `position_m` and `rotation_rad` are the standard deviations of the noise. The reported covariance is
    the covariance of the noise times the parameter `stated`.
    """

    def __init__(self, gt: Trajectory) -> None:
        T_odom_left = se3.inverse(gt.T_world_frame[:1]) @ gt.T_world_frame
        self._T_odom_left = dict(zip(gt.t_ns.tolist(), T_odom_left, strict=True))

    def start(self, rig: Rig, params: Mapping[str, Any], seed: int) -> None:
        """Set the level of noise from the parameters. Raises EstimatorFailure if it is not positive."""
        del rig
        self._sigmas = np.repeat([params["position_m"], params["rotation_rad"]], 3)
        self._stated = params["stated"]
        self._rng = np.random.default_rng([seed, NOISE_STREAM])
        has_noise = (self._sigmas > 0).all()
        if not has_noise or self._stated <= 0:
            raise EstimatorFailure("refused", "position_m, rotation_rad and stated should be more than 0")

    def process(self, frame: Frame) -> Answer:
        """The true pose at a frame, with noise in the axes of odom."""
        noise = self._rng.normal(size=6) * self._sigmas
        T = self._T_odom_left.get(frame.t_ns)
        if T is None:
            return Answer(Result(None, Status.LOST, "no truth"), 0.0, 0.0)
        noise_m = noise[:3]
        R_noise = _rotation(noise[3:])
        T_noisy = se3.transform(R_noise @ T[:3, :3], T[:3, 3] + noise_m)
        covariance = np.diag(self._stated * self._sigmas**2)
        return Answer(Result(T_noisy, covariance=covariance), 0.0, 0.0)

    def finish(self) -> dict[int, Array]:
        """No revised poses."""
        return {}

    def __enter__(self) -> "NoisyTruth":
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing to do, because there is no process."""


def _rotation(vector: Array) -> Array:
    """The matrix (3, 3) of a rotation vector (3,) in rad."""
    half_rad = np.linalg.norm(vector) / 2
    x, y, z = np.sinc(half_rad / np.pi) * vector / 2
    return se3.from_quaternion([x, y, z, np.cos(half_rad)])
