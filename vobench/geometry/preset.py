"""Stereo pairs by name: both lenses, and how the cameras stand to each other.

Figures are published ones; each preset says by whom, and what in it is our assumption.
"""

from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.lens import BrownConrady, KannalaBrandt
from vobench.geometry.rig import LENSES, side_by_side
from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class StereoPreset:
    """Two cameras as one buys or publishes them, before they are put on a robot; `source` says whose figures."""

    left: Camera
    right: Camera
    T_left_right: Array
    source: str

    @property
    def baseline_m(self) -> float:
        """Distance between the two optical centres."""
        return float(np.linalg.norm(self.T_left_right[:3, 3]))

    def at_baseline(self, baseline_m: float) -> Array:
        """T_left_right with the right camera moved along the baseline to that distance."""
        T_left_right = self.T_left_right.copy()
        T_left_right[:3, 3] = T_left_right[:3, 3] / self.baseline_m * baseline_m
        return T_left_right


def _between(T_imu_left: Array, T_imu_right: Array) -> Array:
    return se3.inverse(T_imu_left) @ T_imu_right


def _from_rows(*rows: tuple[float, float, float, float]) -> Array:
    """A transform from its upper three rows, which are printed with too few digits to be a rotation."""
    table = np.array(rows)
    return se3.transform(se3.nearest_rotation(table[:, :3]), table[:, 3])


def _from_quaternion(t_m: tuple[float, float, float], q_xyzw: tuple[float, float, float, float]) -> Array:
    q = np.array(q_xyzw)
    return se3.transform(se3.from_quaternion(q / np.linalg.norm(q)), t_m)


def _paper(lens: Pinhole, reading: str) -> StereoPreset:
    return StereoPreset(
        left=lens,
        right=lens,
        T_left_right=side_by_side(0.12),
        source=f"the paper, section II-B, {reading}; the baseline of 0.12 m is an assumption",
    )


EUROC = StereoPreset(
    left=BrownConrady(
        752, 480, 458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907, 0.00019359, 1.76187114e-05
    ),
    right=BrownConrady(
        752, 480, 457.587, 456.134, 379.999, 255.238, -0.28368365, 0.07451284, -0.00010473, -3.55590700e-05
    ),
    T_left_right=_between(
        _from_rows(
            (0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975),
            (0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768),
            (-0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949),
        ),
        _from_rows(
            (0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556),
            (0.999598781151, 0.0130119051815, 0.0251588363115, 0.0453689425024),
            (-0.0253898008918, 0.0179005838253, 0.999517347078, 0.00786212447038),
        ),
    ),
    source="EuRoC MAV data set (Burri et al., 2016), sensor.yaml of cam0 and cam1",
)

D435I_LENS = Pinhole(848, 480, 427.259765625, 427.259765625, 422.357269287109, 233.807525634766)
D435I = StereoPreset(
    left=D435I_LENS,
    right=D435I_LENS,
    T_left_right=side_by_side(0.050028957),
    source="infrared pair of one D435 as it reports itself, rectified: librealsense issue 11511 (lens), "
    "orb_slam_2_ros issue 46 (baseline); that a D435i has the same stereo module is by its data sheet",
)

ZED2I_LENS = BrownConrady(1280, 720, 531.99, 532.04, 638.79, 364.9, -0.058, 0.032, 0.0005, -0.0009, -0.012)
ZED2I = StereoPreset(
    left=ZED2I_LENS,
    right=ZED2I_LENS,
    T_left_right=side_by_side(0.12),
    source="HD720 at 30 frames/s: lens from a published factory calibration of the 2.1 mm ZED 2 family (left eye), "
    "baseline and chip from Stereolabs, 25.6 us a row from its support pages; "
    "that the right eye equals the left and both are parallel is an assumption",
)

TARTANAIR_LENS = Pinhole(640, 480, 320.0, 320.0, 320.0, 240.0)
TARTANAIR = StereoPreset(
    left=TARTANAIR_LENS,
    right=TARTANAIR_LENS,
    T_left_right=side_by_side(0.25),
    source="TartanAir (Wang et al., 2020), tartanair_tools/data_type.md; a simulated camera",
)

FISHEYE = StereoPreset(
    left=KannalaBrandt(
        512,
        512,
        190.97847715128717,
        190.9733070521226,
        254.93170605935475,
        256.8974428996504,
        0.0034823894022493434,
        0.0007150348452162257,
        -0.0020532361418706202,
        0.00020293673591811182,
    ),
    right=KannalaBrandt(
        512,
        512,
        190.44236969414825,
        190.4344384721956,
        252.59949716835982,
        254.91723064636983,
        0.0034003170790442797,
        0.001766278153469831,
        -0.00266312569781606,
        0.0003299517423931039,
    ),
    T_left_right=_between(
        _from_quaternion(
            (0.0453656607259, -0.0719960019392, -0.0447818071239),
            (0.0132723165788, 0.694725617491, -0.719111722761, 0.00764801952284),
        ),
        _from_quaternion(
            (-0.0556660265249, -0.0701022461789, -0.0475471045069),
            (0.0134102601601, 0.71140347541, -0.702611903198, 0.007859617077),
        ),
    ),
    source="TUM VI (Schubert et al., 2018), calibration of the 512 x 512 export; no model of its chip here",
)

PRESETS = {
    "paper_literal": _paper(LENSES["paper_literal"], "both sides of the sensor counted"),
    "paper_blender": _paper(LENSES["paper_blender"], "the width alone counted, as Blender does"),
    "euroc": EUROC,
    "d435i": D435I,
    "zed2i": ZED2I,
    "tartanair": TARTANAIR,
    "fisheye": FISHEYE,
}
