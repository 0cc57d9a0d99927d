"""Stereo rigs: cameras, mounts, wheels and IMU of a body; presets, declared calibration error, rectification."""

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from vobench.errors import InputError, SettingError, VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, Camera, DoubleSphere, Focal, KannalaBrandt, Pinhole, unit
from vobench.geometry.se3 import Array
from vobench.setting import OneOf, Positive, Triple, nearest_whole, settings

# Focal length, sensor and resolution as the paper gives them (section II-B).
PAPER_FOCAL_MM = 32.0
PAPER_SENSOR_MM = (35.0, 28.18)
PAPER_SIZE_PX = (720, 480)


@settings(kw_only=False)
class WheelGeometry:
    """Nominal geometry of the two driven wheels, as an odometer believes it."""

    radius_m: Positive
    track_m: Positive
    ticks_per_revolution: Annotated[int, Gt(0)]


# Radius and track: CoppeliaSim's Pioneer 3-DX; 500 lines x 4 edges x gear 38.3, from the data sheet.
PIONEER_WHEELS = WheelGeometry(radius_m=0.0975, track_m=0.331, ticks_per_revolution=76_600)


@dataclass(frozen=True, slots=True)
class ImuCalibration:
    """An IMU on the body as its calibration has it: where it sits, and how noisy it is said to be.

    White noise as densities in rad/s/√Hz and m/s²/√Hz, the walks of both biases in rad/s²/√Hz and
    m/s³/√Hz: the four numbers of Kalibr's imu.yaml.
    """

    T_body_imu: Array
    rate_hz: float
    gyro_noise: float
    accel_noise: float
    gyro_walk: float
    accel_walk: float


Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("left", "right")
ONE_CAMERA = "this rig has one camera, and a stereo pair is asked for"


@dataclass(frozen=True, slots=True)
class Rig:
    """The cameras, where they sit on the body, the wheels and the IMU: all the calibration there is.

    The left camera is the reference; all look along their own z axis. A rig of one camera has no
    right one; wheels and imu are None where the recording has none.
    """

    left: Camera
    right: Camera | None
    T_body_left: Array
    T_body_right: Array | None
    wheels: WheelGeometry | None = None
    imu: ImuCalibration | None = None

    @property
    def sides(self) -> tuple[Side, ...]:
        """The cameras there are."""
        return SIDES if self.right else SIDES[:1]

    def camera(self, side: Side) -> Camera:
        """One of the cameras. Raises InputError where the rig has no right one."""
        camera = self.left if side == "left" else self.right
        if camera is None:
            raise InputError(ONE_CAMERA)
        return camera

    def T_body_camera(self, side: Side) -> Array:
        """Where it sits on the body. Raises InputError where the rig has no right one."""
        T_body_camera = self.T_body_left if side == "left" else self.T_body_right
        if T_body_camera is None:
            raise InputError(ONE_CAMERA)
        return T_body_camera

    @property
    def T_left_right(self) -> Array:
        """Pose of the right camera seen from the left one."""
        return se3.inverse(self.T_body_left) @ self.T_body_camera("right")

    @property
    def baseline_m(self) -> float:
        """Distance between the two optical centres."""
        return float(np.linalg.norm(self.T_left_right[:3, 3]))


def paper_lens(*, square_pixels: bool) -> Pinhole:
    """The paper's 32 mm lens on 35 x 28.18 mm and 720 x 480 pixels, in either reading.

    Taken literally both sensor sides count and pixels are not square (fx 658.3, fy 545.1);
    Blender fits the width alone, which gives fx = fy = 658.3.
    """
    width, height = PAPER_SIZE_PX
    fx = PAPER_FOCAL_MM / PAPER_SENSOR_MM[0] * width
    fy = fx if square_pixels else PAPER_FOCAL_MM / PAPER_SENSOR_MM[1] * height
    return Pinhole(width, height, fx, fy, (width - 1) / 2, (height - 1) / 2)


LENSES = {"paper_literal": paper_lens(square_pixels=False), "paper_blender": paper_lens(square_pixels=True)}


def looking(*, pitch_deg: float, position_m: tuple[float, float, float]) -> Array:
    """T_body_camera of a camera that looks ahead and `pitch_deg` below the horizon (90: at the floor)."""
    pitch = np.deg2rad(pitch_deg)
    forward = np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
    right = np.array([0.0, -1.0, 0.0])
    return se3.transform(np.stack([right, np.cross(forward, right), forward], -1), position_m)


def mounted(
    left: Camera,
    right: Camera,
    T_left_right: Array,
    *,
    pitch_deg: float,
    forward_m: float = 0.25,
    height_m: float = 0.4,
    wheels: WheelGeometry = PIONEER_WHEELS,
) -> Rig:
    """A pair astride the robot's middle, `forward_m` ahead of its axle; pitch and height are the left camera's."""
    baseline_m = float(np.linalg.norm(T_left_right[:3, 3]))
    T_body_left = looking(pitch_deg=pitch_deg, position_m=(forward_m, baseline_m / 2, height_m))
    return Rig(left, right, T_body_left, T_body_left @ T_left_right, wheels)


def stereo_rig(lens: Camera, *, baseline_m: float = 0.12, **mount: Any) -> Rig:
    """Two equal cameras side by side across the robot, as `mounted`."""
    return mounted(lens, lens, side_by_side(baseline_m), **mount)


def side_by_side(baseline_m: float) -> Array:
    """T_left_right of two parallel cameras."""
    return se3.transform(np.eye(3), [baseline_m, 0.0, 0.0])


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
        *(512, 512, 190.97847715128717, 190.9733070521226, 254.93170605935475, 256.8974428996504),
        *(0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182),
    ),
    right=KannalaBrandt(
        *(512, 512, 190.44236969414825, 190.4344384721956, 252.59949716835982, 254.91723064636983),
        *(0.0034003170790442797, 0.001766278153469831, -0.00266312569781606, 0.0003299517423931039),
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


LENS_MODELS: dict[str, Any] = {
    "pinhole": Pinhole,
    "brown_conrady": BrownConrady,
    "kannala_brandt": KannalaBrandt,
    "double_sphere": DoubleSphere,
}


@settings()
class Lens:
    """One lens: its model, and that model's numbers; `distortion` in the model's own order."""

    model: Annotated[str, OneOf("model of a lens", LENS_MODELS)] = "pinhole"
    size_px: tuple[Annotated[int, Gt(0)], Annotated[int, Gt(0)]]
    focal_px: tuple[Positive, Positive]
    center_px: tuple[float, float]
    distortion: tuple[float, ...] = ()

    def build(self) -> Camera:
        """The camera. Raises SettingError where the model takes another number of coefficients."""
        model = LENS_MODELS[self.model]
        takes = model.coefficients
        if len(self.distortion) > len(takes) or (len(self.distortion) < min(len(takes), 2)):
            wanted = ", ".join(takes) or "nothing"
            raise SettingError(f"should be {wanted} for {self.model}, but are {list(self.distortion)}", "distortion")
        camera: Camera = model(*self.size_px, *self.focal_px, *self.center_px, *self.distortion)
        return camera


def lens_of(camera: Camera) -> Lens:
    """The lens that says what a camera is. Raises InputError for a camera without a focal length."""
    model = next((name for name, each in LENS_MODELS.items() if isinstance(camera, each)), None)
    if model is None or not isinstance(camera, Focal):
        raise InputError(f"a rig of a suite has lenses with a focal length, and {camera} is none")
    return Lens(
        model=model,
        size_px=(camera.width_px, camera.height_px),
        focal_px=(camera.fx_px, camera.fy_px),
        center_px=(camera.cx_px, camera.cy_px),
        distortion=tuple(getattr(camera, name) for name in camera.coefficients),
    )


@settings()
class OwnPair:
    """Two lenses of one's own: where the right one is in the left one's axes, and how it is turned (rotation vector).

    Without `right` it is as the left one.
    """

    left: Lens
    right: Lens | None = None
    right_at_m: Triple
    right_turned_deg: Triple = (0.0, 0.0, 0.0)

    def preset(self) -> StereoPreset:
        """The pair before it is put on a body."""
        from scipy.spatial.transform import Rotation

        R = Rotation.from_rotvec(np.array(self.right_turned_deg), degrees=True).as_matrix()
        left = self.left.build()
        right = self.right.build() if self.right else left
        return StereoPreset(left, right, se3.transform(R, self.right_at_m), "the suite")


def own_pair(rig: Rig) -> OwnPair:
    """The pair of a rig, as a suite says it. Raises InputError where it has one camera."""
    from scipy.spatial.transform import Rotation

    T = rig.T_left_right
    right_at_m: Any = tuple(T[:3, 3].tolist())
    turned: Any = tuple(Rotation.from_matrix(T[:3, :3]).as_rotvec(degrees=True).tolist())
    return OwnPair(
        left=lens_of(rig.left), right=lens_of(rig.camera("right")), right_at_m=right_at_m, right_turned_deg=turned
    )


Ratio = Annotated[float, Gt(-1), Lt(1)]
Angle = Annotated[float, Ge(-10), Le(10)]


@settings()
class EyeError:
    """One camera minus what its calibration says; it is turned as the right one of CalibrationError is."""

    focal_ratio: Ratio = 0.0
    center_px: tuple[float, float] = (0.0, 0.0)
    distortion_ratio: Ratio = 0.0
    roll_deg: Angle = 0.0
    pitch_deg: Angle = 0.0
    yaw_deg: Angle = 0.0


Level = Literal["none", "factory", "worn"]


@settings()
class CalibrationError:
    """The true rig minus what its calibration says; ratios are shares of what it says.

    Focal length, centre and distortion are off in both cameras alike. The right camera is turned, about its own z
    (roll, to the right), x (pitch, upwards) and y (yaw, to the right), and shifted along the baseline. `left` and
    `right` add what is off in one camera alone. A level other than none adds errors of its size, which `drawn` draws.
    """

    level: Level = "none"
    focal_ratio: Ratio = 0.0
    center_px: tuple[float, float] = (0.0, 0.0)
    distortion_ratio: Ratio = 0.0
    baseline_ratio: Ratio = 0.0
    right_roll_deg: Angle = 0.0
    right_pitch_deg: Angle = 0.0
    right_yaw_deg: Angle = 0.0
    left: EyeError = EyeError()
    right: EyeError = EyeError()

    def of_eye(self, side: Side) -> EyeError:
        """All that is off in one camera."""
        own, is_right = (self.left, 0) if side == "left" else (self.right, 1)
        return EyeError(
            focal_ratio=self.focal_ratio + own.focal_ratio,
            center_px=(self.center_px[0] + own.center_px[0], self.center_px[1] + own.center_px[1]),
            distortion_ratio=self.distortion_ratio + own.distortion_ratio,
            roll_deg=is_right * self.right_roll_deg + own.roll_deg,
            pitch_deg=is_right * self.right_pitch_deg + own.pitch_deg,
            yaw_deg=is_right * self.right_yaw_deg + own.yaw_deg,
        )


@dataclass(frozen=True, slots=True)
class Residual:
    """The usual size of what a calibration leaves over: of turns, what they shift in the picture."""

    yaw_px: float  # in the middle, an offset of every disparity
    roll_px: float  # of rows, at the picture's side
    pitch_px: float  # of all rows
    focal_ratio: float
    baseline_ratio: float
    center_px: tuple[float, float]
    distortion_ratio: float


# By experiment with recordings of cars and drones: the first has the row errors of EuRoC, the second those of KITTI,
# whose disparities are off by 0.2 to 0.4 px in the middle.
RESIDUALS: dict[Level, Residual] = {
    "factory": Residual(0.17, 0.25, 0.12, 0.001, 0.001, (0.5, 0.3), 0.003),
    "worn": Residual(0.55, 0.55, 0.3, 0.005, 0.004, (3.0, 2.0), 0.02),
}
SPREAD = 0.25  # a drawn error is its usual size, more or less by up to this share


def drawn(error: CalibrationError, nominal: Rig, rng: np.random.Generator) -> CalibrationError:
    """The error with what its level stands for: sizes near the usual ones, signs by chance.

    Turns are drawn in pixels, for so a calibration is off, and one of this focal length shifts the picture that far.
    """
    if error.level == "none":
        return error
    usual = RESIDUALS[error.level]
    factor = rng.choice([-1.0, 1.0], 8) * rng.uniform(1 - SPREAD, 1 + SPREAD, 8)
    left = nominal.left
    has_focal = isinstance(left, Focal)
    is_bent = any(getattr(left, name) for name in left.coefficients)
    f_px = float(left.K[0, 0])
    center_px = usual.center_px if has_focal else (0.0, 0.0)

    def turned(given_deg: float, shift_px: float, arm_px: float, by: float) -> float:
        return given_deg + by * float(np.degrees(np.arctan(shift_px / arm_px)))

    return replace(
        error,
        level="none",
        right_yaw_deg=turned(error.right_yaw_deg, usual.yaw_px, f_px, factor[0]),
        right_roll_deg=turned(error.right_roll_deg, usual.roll_px, left.width_px / 2, factor[1]),
        right_pitch_deg=turned(error.right_pitch_deg, usual.pitch_px, f_px, factor[2]),
        focal_ratio=error.focal_ratio + usual.focal_ratio * factor[3] * has_focal,
        baseline_ratio=error.baseline_ratio + usual.baseline_ratio * factor[4],
        center_px=(error.center_px[0] + center_px[0] * factor[5], error.center_px[1] + center_px[1] * factor[6]),
        distortion_ratio=error.distortion_ratio + usual.distortion_ratio * factor[7] * is_bent,
    )


def true_rig(nominal: Rig, error: CalibrationError) -> Rig:
    """The rig that the pictures are made with. Raises VobenchError where an error has nothing to act on."""
    left = error.of_eye("left")
    right = error.of_eye("right")
    # Written so that no error at all changes no bit.
    T_body_right = nominal.T_body_camera("right").copy()
    T_body_right[:3, 3] += error.baseline_ratio * (T_body_right - nominal.T_body_left)[:3, 3]
    return replace(
        nominal,
        left=true_camera(nominal.left, left),
        right=true_camera(nominal.camera("right"), right),
        T_body_left=_turned(nominal.T_body_left, left),
        T_body_right=_turned(T_body_right, right),
    )


def true_camera(nominal: Camera, error: EyeError) -> Camera:
    """The camera with its focal length, centre and distortion off. Raises VobenchError."""
    if error.distortion_ratio and not any(getattr(nominal, name) for name in nominal.coefficients):
        raise VobenchError(f"distortion_ratio {error.distortion_ratio:g} needs a lens with distortion, got {nominal}")
    if not isinstance(nominal, Focal):
        if error.focal_ratio or any(error.center_px):
            raise VobenchError(f"focal_ratio and center_px need a camera with a focal length, got {nominal}")
        return nominal
    return replace(
        nominal,
        fx_px=nominal.fx_px * (1 + error.focal_ratio),
        fy_px=nominal.fy_px * (1 + error.focal_ratio),
        cx_px=nominal.cx_px + error.center_px[0],
        cy_px=nominal.cy_px + error.center_px[1],
        **{name: getattr(nominal, name) * (1 + error.distortion_ratio) for name in nominal.coefficients},
    )


def _turned(T_body_camera: Array, error: EyeError) -> Array:
    """The camera's pose after its turns."""
    angles_deg = [error.roll_deg, error.pitch_deg, error.yaw_deg]
    if not any(angles_deg):
        return T_body_camera
    from scipy.spatial.transform import Rotation

    T_body_turned = T_body_camera.copy()
    T_body_turned[:3, :3] @= Rotation.from_euler("ZXY", np.array(angles_deg), degrees=True).as_matrix()
    return T_body_turned


SMALLEST_SIDE_PX = 2


def resized(camera: Camera, scale: float) -> Camera:
    """The camera with `scale` times as many pixels across, behind the same lens.

    Raises VobenchError where it has no focal length, or where half a pixel would be left.
    """
    if scale == 1:
        return camera
    width_px = nearest_whole(camera.width_px * scale) or 0
    height_px = nearest_whole(camera.height_px * scale) or 0
    if not isinstance(camera, Focal) or min(width_px, height_px) < SMALLEST_SIDE_PX:
        raise VobenchError(
            f"picture_scale {scale:g} should leave whole pixels of a camera with a focal length, got {camera}"
        )
    return replace(
        camera,
        width_px=width_px,
        height_px=height_px,
        fx_px=camera.fx_px * scale,
        fy_px=camera.fy_px * scale,
        cx_px=(camera.cx_px + 0.5) * scale - 0.5,
        cy_px=(camera.cy_px + 0.5) * scale - 0.5,
    )


PARALLEL_RAD = 1e-6  # a pair this straight is rectified as it stands
MAX_TURN_RAD = np.deg2rad(30)  # beyond it the two would hardly look at the same things


@dataclass(frozen=True, slots=True)
class Rectification:
    """Views from the two optical centres that are parallel to each other and across the baseline.

    K is that of both views. A point's rows agree in them, and its columns differ by
    K[0, 0] · baseline_m / z.
    """

    K: Array
    baseline_m: float
    R_view_left: Array
    R_view_right: Array

    @property
    def P_left(self) -> Array:
        """The (3, 4) matrix that sends points in metres, in the left view's axes, to its pixels."""
        return projection(self.K, 0.0)

    @property
    def P_right(self) -> Array:
        """The (3, 4) matrix that sends points in metres, in the left view's axes, to the right view's pixels."""
        return projection(self.K, self.baseline_m)


def projection(K: Array, shift_m: float) -> Array:
    """The (3, 4) matrix of a pinhole `shift_m` to the right of the axes that points are given in."""
    return np.hstack([K, [[-K[0, 0] * shift_m], [0.0], [0.0]]])


def rectification(rig: Rig) -> Rectification | None:
    """The views of a pair, turned as little as may be; None where there is no right camera, or it is not to the right.

    Their x runs along the baseline, their z as near as possible to the mean of the optical axes.
    Source: Fusiello, Trucco and Verri (2000).
    """
    if rig.right is None:
        return None
    R_left_right = rig.T_left_right[:3, :3]
    t = rig.T_left_right[:3, 3]
    if t[0] <= 0:
        return None
    x = unit(t)
    ahead = np.array([0.0, 0.0, 1.0]) + R_left_right[:, 2]
    z = ahead - (ahead @ x) * x
    if not z.any():
        return None
    z = unit(z)
    R_view_left = np.stack([x, np.cross(z, x), z])
    turns = [R_view_left, R_view_left @ R_left_right]
    angles = [float(se3.rotation_angle(R)) for R in turns]
    if max(angles) > MAX_TURN_RAD:
        return None
    if max(angles) <= PARALLEL_RAD:
        turns = [np.eye(3), np.eye(3)]
    return Rectification(rig.left.K, rig.baseline_m, turns[0], turns[1])
