"""Stereo rigs: cameras, mounts, wheels and IMU of a body; presets, declared calibration error, rectification."""

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt

from vobench.errors import InputError, SettingError, VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, Camera, DoubleSphere, Focal, KannalaBrandt, Pinhole
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.setting import OneOf, Positive, Triple, nearest_whole, settings

# Focal length, sensor and resolution as the paper gives them (section II-B).
PAPER_FOCAL_MM = 32.0
PAPER_SENSOR_MM = (35.0, 28.18)
PAPER_SIZE_PX = (720, 480)


@settings(kw_only=False)
class WheelGeometry:
    """Nominal geometry of the two driven wheels, which the odometry uses."""

    radius_m: Positive
    track_m: Positive
    ticks_per_revolution: Annotated[int, Gt(0)]


# Radius and track: CoppeliaSim's Pioneer 3-DX; 500 lines x 4 edges x gear 38.3, from the data sheet.
PIONEER_WHEELS = WheelGeometry(radius_m=0.0975, track_m=0.331, ticks_per_revolution=76_600)


@dataclass(frozen=True, slots=True)
class ImuCalibration:
    """The nominal calibration of an IMU on the body: its pose, its rate and its noise.

    White noise is given as densities in rad/s/√Hz and m/s²/√Hz, the random walks of both biases in rad/s²/√Hz and
    m/s³/√Hz: the four numbers of Kalibr's imu.yaml.
    """

    T_body_imu: Array
    rate_hz: float
    gyro_noise: float
    accel_noise: float
    gyro_walk: float
    accel_walk: float


Position = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Side = Literal["left", "right"]
SIDES: tuple[Side, ...] = ("left", "right")
ONE_CAMERA = "a stereo pair needs two cameras, but this rig has one"


@dataclass(frozen=True, slots=True)
class Rig:
    """The complete calibration of a body: cameras and their poses, wheels and IMU.

    The left camera is the reference; each camera looks along its z axis. A rig of one camera has no
    right one; `wheels` and `imu` are None for a recording without them.
    """

    left: Camera
    right: Camera | None
    T_body_left: Array
    T_body_right: Array | None
    wheels: WheelGeometry | None = None
    imu: ImuCalibration | None = None

    @property
    def sides(self) -> tuple[Side, ...]:
        """The sides that have a camera."""
        return SIDES if self.right else SIDES[:1]

    def camera(self, side: Side) -> Camera:
        """The camera of one side. Raises InputError if the rig has no right one."""
        camera = self.left if side == "left" else self.right
        if camera is None:
            raise InputError(ONE_CAMERA)
        return camera

    def T_body_camera(self, side: Side) -> Array:
        """The pose (4, 4) of one camera on the body. Raises InputError if the rig has no right one."""
        T_body_camera = self.T_body_left if side == "left" else self.T_body_right
        if T_body_camera is None:
            raise InputError(ONE_CAMERA)
        return T_body_camera

    @property
    def T_left_right(self) -> Array:
        """The pose (4, 4) of the right camera in the left camera's frame."""
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
    width_px, height_px = PAPER_SIZE_PX
    width_mm, height_mm = PAPER_SENSOR_MM
    fx_px = PAPER_FOCAL_MM / width_mm * width_px
    fy_px = fx_px if square_pixels else PAPER_FOCAL_MM / height_mm * height_px
    return Pinhole(
        width_px=width_px,
        height_px=height_px,
        fx_px=fx_px,
        fy_px=fy_px,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
    )


LENSES = {
    "paper_literal": paper_lens(square_pixels=False),
    "paper_blender": paper_lens(square_pixels=True),
}


def looking(*, pitch_deg: float, position_m: tuple[float, float, float]) -> Array:
    """T_body_camera of a camera that looks ahead and `pitch_deg` below the horizon (90: at the floor)."""
    pitch = np.deg2rad(pitch_deg)
    forward = np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
    right = np.array([0.0, -1.0, 0.0])
    down = np.cross(forward, right)
    R_body_camera = np.stack([right, down, forward], -1)
    return se3.transform(R_body_camera, position_m)


@settings()
class Mount:
    """Where the body of a trajectory carries its cameras, and how far these look down.

    What is None remains as in the rig.
    """

    pitch_deg: Annotated[float, Ge(-90), Le(90)] | None = None
    forward_m: float | None = None
    height_m: float | None = None

    @property
    def replaced(self) -> dict[str, Any]:
        """The keys of a rig that are replaced, and their values."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        return {key: value for key, value in values.items() if value is not None}


def mounted_rig(
    left: Camera,
    right: Camera,
    T_left_right: Array,
    *,
    pitch_deg: float,
    forward_m: float = 0.25,
    height_m: float = 0.4,
    wheels: WheelGeometry = PIONEER_WHEELS,
) -> Rig:
    """A pair centred on the robot, `forward_m` ahead of its axle; pitch and height are the left camera's."""
    baseline_m = float(np.linalg.norm(T_left_right[:3, 3]))
    left_position_m = (forward_m, baseline_m / 2, height_m)
    T_body_left = looking(pitch_deg=pitch_deg, position_m=left_position_m)
    T_body_right = T_body_left @ T_left_right
    return Rig(left, right, T_body_left, T_body_right, wheels)


def stereo_rig(lens: Camera, *, baseline_m: float = 0.12, **mount: Any) -> Rig:
    """A rig of two equal, parallel cameras side by side, with the arguments of `mounted`."""
    T_left_right = side_by_side(baseline_m)
    return mounted_rig(lens, lens, T_left_right, **mount)


def side_by_side(baseline_m: float) -> Array:
    """T_left_right of two parallel cameras."""
    return se3.transform(np.eye(3), [baseline_m, 0.0, 0.0])


@dataclass(frozen=True, slots=True)
class StereoPreset:
    """Two cameras as sold or published, before they are put on a robot; `source` cites the figures."""

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
        direction = T_left_right[:3, 3] / self.baseline_m
        T_left_right[:3, 3] = direction * baseline_m
        return T_left_right


def _between(T_imu_left: Array, T_imu_right: Array) -> Array:
    """T_left_right of two cameras whose poses are published relative to an IMU."""
    return se3.inverse(T_imu_left) @ T_imu_right


def _from_rows(*rows: tuple[float, float, float, float]) -> Array:
    """A transform from its upper three rows, which are printed with too few digits to be a rotation."""
    table = np.array(rows)
    R = se3.nearest_rotation(table[:, :3])
    t_m = table[:, 3]
    return se3.transform(R, t_m)


def _from_quaternion(t_m: Position, q_xyzw: Quaternion) -> Array:
    """A transform from its translation and its quaternion, which is printed with few digits."""
    q = np.array(q_xyzw)
    R = se3.from_quaternion(q / np.linalg.norm(q))
    return se3.transform(R, t_m)


def _paper(lens: Pinhole, reading: str) -> StereoPreset:
    return StereoPreset(
        left=lens,
        right=lens,
        T_left_right=side_by_side(0.12),
        source=f"the paper, section II-B, {reading}; the baseline of 0.12 m is an assumption",
    )


EUROC = StereoPreset(
    left=BrownConrady(
        width_px=752,
        height_px=480,
        fx_px=458.654,
        fy_px=457.296,
        cx_px=367.215,
        cy_px=248.375,
        k1=-0.28340811,
        k2=0.07395907,
        p1=0.00019359,
        p2=1.76187114e-05,
    ),
    right=BrownConrady(
        width_px=752,
        height_px=480,
        fx_px=457.587,
        fy_px=456.134,
        cx_px=379.999,
        cy_px=255.238,
        k1=-0.28368365,
        k2=0.07451284,
        p1=-0.00010473,
        p2=-3.55590700e-05,
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

ZED2I_LENS = BrownConrady(
    width_px=1280,
    height_px=720,
    fx_px=531.99,
    fy_px=532.04,
    cx_px=638.79,
    cy_px=364.9,
    k1=-0.058,
    k2=0.032,
    p1=0.0005,
    p2=-0.0009,
    k3=-0.012,
)
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
        width_px=512,
        height_px=512,
        fx_px=190.97847715128717,
        fy_px=190.9733070521226,
        cx_px=254.93170605935475,
        cy_px=256.8974428996504,
        k1=0.0034823894022493434,
        k2=0.0007150348452162257,
        k3=-0.0020532361418706202,
        k4=0.00020293673591811182,
    ),
    right=KannalaBrandt(
        width_px=512,
        height_px=512,
        fx_px=190.44236969414825,
        fy_px=190.4344384721956,
        cx_px=252.59949716835982,
        cy_px=254.91723064636983,
        k1=0.0034003170790442797,
        k2=0.001766278153469831,
        k3=-0.00266312569781606,
        k4=0.0003299517423931039,
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
    """One lens: its model and the parameters of that model, `distortion` in the model's order."""

    model: Annotated[str, OneOf("model of a lens", LENS_MODELS)] = "pinhole"
    size_px: tuple[Annotated[int, Gt(0)], Annotated[int, Gt(0)]]
    focal_px: tuple[Positive, Positive]
    center_px: tuple[float, float]
    distortion: tuple[float, ...] = ()

    def build(self) -> Camera:
        """The camera. Raises SettingError where the model takes another number of coefficients."""
        model = LENS_MODELS[self.model]
        coefficients = model.coefficients
        most = len(coefficients)
        least = min(most, 2)
        if not least <= len(self.distortion) <= most:
            expected = ", ".join(coefficients) or "nothing"
            raise SettingError(f"should be {expected} for {self.model}, but are {list(self.distortion)}", "distortion")
        camera: Camera = model(
            *self.size_px,
            *self.focal_px,
            *self.center_px,
            *self.distortion,
        )
        return camera


def lens_of(camera: Camera) -> Lens:
    """The settings of a camera's lens. Raises InputError for a camera without a focal length."""
    names = [name for name, model in LENS_MODELS.items() if isinstance(camera, model)]
    if not names or not isinstance(camera, Focal):
        raise InputError(f"the lenses of a suite's rig need a focal length, which this camera lacks: {camera}")
    return Lens(
        model=names[0],
        size_px=(camera.width_px, camera.height_px),
        focal_px=(camera.fx_px, camera.fy_px),
        center_px=(camera.cx_px, camera.cy_px),
        distortion=tuple(getattr(camera, name) for name in camera.coefficients),
    )


@settings()
class CustomStereoPair:
    """Two user-defined lenses, with the right camera's position and rotation vector in the left camera's frame.

    Without `right` both lenses are equal.
    """

    left: Lens
    right: Lens | None = None
    right_at_m: Triple
    right_turned_deg: Triple = (0.0, 0.0, 0.0)

    def preset(self) -> StereoPreset:
        """The pair before it is put on a body."""
        from scipy.spatial.transform import Rotation

        turn_deg = np.array(self.right_turned_deg)
        R_left_right = Rotation.from_rotvec(turn_deg, degrees=True).as_matrix()
        left = self.left.build()
        right = self.right.build() if self.right else left
        T_left_right = se3.transform(R_left_right, self.right_at_m)
        return StereoPreset(left, right, T_left_right, "the suite")


def custom_stereo_pair(rig: Rig) -> CustomStereoPair:
    """The pair of a rig as the settings of a suite. Raises InputError if the rig has one camera."""
    from scipy.spatial.transform import Rotation

    T = rig.T_left_right
    turn = Rotation.from_matrix(T[:3, :3])
    right_at_m: Any = tuple(T[:3, 3].tolist())
    right_turned_deg: Any = tuple(turn.as_rotvec(degrees=True).tolist())
    return CustomStereoPair(
        left=lens_of(rig.left),
        right=lens_of(rig.camera("right")),
        right_at_m=right_at_m,
        right_turned_deg=right_turned_deg,
    )


Ratio = Annotated[float, Gt(-1), Lt(1)]
Angle = Annotated[float, Ge(-10), Le(10)]
Tangential = Annotated[float, Ge(-0.1), Le(0.1)]


@settings()
class CameraError:
    """The true parameters of one camera minus the nominal ones; turns are those of CalibrationError.

    `tangential` is added to p1 and p2 of a Brown–Conrady lens; a pinhole becomes one.
    """

    focal_ratio: Ratio = 0.0
    center_px: tuple[float, float] = (0.0, 0.0)
    distortion_ratio: Ratio = 0.0
    tangential: tuple[Tangential, Tangential] = (0.0, 0.0)
    roll_deg: Angle = 0.0
    pitch_deg: Angle = 0.0
    yaw_deg: Angle = 0.0


Level = Literal["none", "factory", "worn"]


@settings()
class CalibrationError:
    """The true rig minus the nominal one; ratios are relative to the nominal value.

    Errors of focal length, centre and distortion apply to both cameras. The right camera is turned, about its own z
    (roll, to the right), x (pitch, upwards) and y (yaw, to the right), and shifted along the baseline. `left` and
    `right` add errors of a single camera. A level other than none adds random errors of its size (see `drawn`).
    """

    level: Level = "none"
    focal_ratio: Ratio = 0.0
    center_px: tuple[float, float] = (0.0, 0.0)
    distortion_ratio: Ratio = 0.0
    baseline_ratio: Ratio = 0.0
    right_roll_deg: Angle = 0.0
    right_pitch_deg: Angle = 0.0
    right_yaw_deg: Angle = 0.0
    left: CameraError = CameraError()
    right: CameraError = CameraError()

    def of_eye(self, side: Side) -> CameraError:
        """The total error of one camera."""
        single = self.left if side == "left" else self.right
        right_turns_deg = (self.right_roll_deg, self.right_pitch_deg, self.right_yaw_deg)
        roll_deg, pitch_deg, yaw_deg = right_turns_deg if side == "right" else (0.0, 0.0, 0.0)
        center_x_px = self.center_px[0] + single.center_px[0]
        center_y_px = self.center_px[1] + single.center_px[1]
        return CameraError(
            focal_ratio=self.focal_ratio + single.focal_ratio,
            center_px=(center_x_px, center_y_px),
            distortion_ratio=self.distortion_ratio + single.distortion_ratio,
            tangential=single.tangential,
            roll_deg=roll_deg + single.roll_deg,
            pitch_deg=pitch_deg + single.pitch_deg,
            yaw_deg=yaw_deg + single.yaw_deg,
        )


@dataclass(frozen=True, slots=True)
class CalibrationResidual:
    """The usual size of the errors that a calibration leaves; of turns, the shift that they cause in the image."""

    yaw_px: float  # at the centre, an offset of every disparity
    roll_px: float  # of rows, at the left and right edges
    pitch_px: float  # of all rows
    focal_ratio: float
    baseline_ratio: float
    center_px: tuple[float, float]
    distortion_ratio: float


# By experiment with recordings of cars and drones: the first has the row errors of EuRoC, the second those of KITTI,
# whose disparities are off by 0.2 to 0.4 px at the centre.
RESIDUALS: dict[Level, CalibrationResidual] = {
    "factory": CalibrationResidual(
        yaw_px=0.17,
        roll_px=0.25,
        pitch_px=0.12,
        focal_ratio=0.001,
        baseline_ratio=0.001,
        center_px=(0.5, 0.3),
        distortion_ratio=0.003,
    ),
    "worn": CalibrationResidual(
        yaw_px=0.55,
        roll_px=0.55,
        pitch_px=0.3,
        focal_ratio=0.005,
        baseline_ratio=0.004,
        center_px=(3.0, 2.0),
        distortion_ratio=0.02,
    ),
}
SPREAD = 0.25  # a drawn error is its usual size, more or less by up to this share


def drawn_calibration_error(
    error: CalibrationError,
    nominal: Rig,
    rng: np.random.Generator,
) -> CalibrationError:
    """The error with the errors of its level added: sizes near the usual ones, random signs.

    Turns are drawn as the shift in pixels that they cause, since calibrations are off by that much.
    """
    if error.level == "none":
        return error
    usual = RESIDUALS[error.level]
    signs = rng.choice([-1.0, 1.0], 8)
    sizes = rng.uniform(1 - SPREAD, 1 + SPREAD, 8)
    yaw, roll, pitch, focal, baseline, center_x, center_y, distortion = signs * sizes

    left = nominal.left
    f_px = float(left.K[0, 0])
    half_width_px = left.width_px / 2
    has_focal_length = isinstance(left, Focal)
    has_distortion = any(getattr(left, name) for name in left.coefficients)
    usual_center_x_px, usual_center_y_px = usual.center_px if has_focal_length else (0.0, 0.0)
    center_x_px = error.center_px[0] + usual_center_x_px * center_x
    center_y_px = error.center_px[1] + usual_center_y_px * center_y

    def turn_deg(shift_px: float, arm_px: float) -> float:
        """The angle that shifts a point at this distance by a number of pixels."""
        return float(np.degrees(np.arctan(shift_px / arm_px)))

    return replace(
        error,
        level="none",
        right_yaw_deg=error.right_yaw_deg + yaw * turn_deg(usual.yaw_px, f_px),
        right_roll_deg=error.right_roll_deg + roll * turn_deg(usual.roll_px, half_width_px),
        right_pitch_deg=error.right_pitch_deg + pitch * turn_deg(usual.pitch_px, f_px),
        focal_ratio=error.focal_ratio + usual.focal_ratio * focal * has_focal_length,
        baseline_ratio=error.baseline_ratio + usual.baseline_ratio * baseline,
        center_px=(center_x_px, center_y_px),
        distortion_ratio=error.distortion_ratio + usual.distortion_ratio * distortion * has_distortion,
    )


def true_rig(nominal: Rig, error: CalibrationError) -> Rig:
    """The rig that images are rendered with. Raises VobenchError for an error that has nothing to act on."""
    left_error = error.of_eye("left")
    right_error = error.of_eye("right")
    # The baseline's change is added, so that an error of 0 changes no bit.
    T_body_right = nominal.T_body_camera("right").copy()
    baseline_m = (T_body_right - nominal.T_body_left)[:3, 3]
    T_body_right[:3, 3] += error.baseline_ratio * baseline_m
    return replace(
        nominal,
        left=true_camera(nominal.left, left_error),
        right=true_camera(nominal.camera("right"), right_error),
        T_body_left=turned(nominal.T_body_left, left_error),
        T_body_right=turned(T_body_right, right_error),
    )


def has_tangential(camera: Camera) -> bool:
    """Whether a camera can have an error of `tangential`."""
    return isinstance(camera, (Pinhole, BrownConrady))


def true_camera(nominal: Camera, error: CameraError) -> Camera:
    """The camera with the errors of its focal length, centre and distortion. Raises VobenchError."""
    coefficients = {name: getattr(nominal, name) for name in nominal.coefficients}
    if error.distortion_ratio and not any(coefficients.values()):
        raise VobenchError(f"distortion_ratio {error.distortion_ratio:g} needs a lens with distortion, got {nominal}")
    if any(error.tangential) and not has_tangential(nominal):
        raise VobenchError(f"tangential needs a pinhole or a lens of model brown_conrady, got {nominal}")
    if not isinstance(nominal, Focal):
        if error.focal_ratio or any(error.center_px):
            raise VobenchError(f"focal_ratio and center_px need a camera with a focal length, got {nominal}")
        return nominal
    distortion = {name: value * (1 + error.distortion_ratio) for name, value in coefficients.items()}
    camera = replace(
        nominal,
        fx_px=nominal.fx_px * (1 + error.focal_ratio),
        fy_px=nominal.fy_px * (1 + error.focal_ratio),
        cx_px=nominal.cx_px + error.center_px[0],
        cy_px=nominal.cy_px + error.center_px[1],
        **distortion,
    )
    return _with_tangential(camera, error.tangential) if any(error.tangential) else camera


def _with_tangential(camera: Focal, tangential: tuple[float, float]) -> BrownConrady:
    """The camera with these numbers added to p1 and p2."""
    p1, p2 = tangential
    if isinstance(camera, BrownConrady):
        return replace(camera, p1=camera.p1 + p1, p2=camera.p2 + p2)
    return BrownConrady(
        width_px=camera.width_px,
        height_px=camera.height_px,
        fx_px=camera.fx_px,
        fy_px=camera.fy_px,
        cx_px=camera.cx_px,
        cy_px=camera.cy_px,
        k1=0.0,
        k2=0.0,
        p1=p1,
        p2=p2,
    )


def turned(T_body_camera: Array, error: CameraError) -> Array:
    """The camera's pose after its turns."""
    angles_deg = [error.roll_deg, error.pitch_deg, error.yaw_deg]
    if not any(angles_deg):
        return T_body_camera
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("ZXY", np.array(angles_deg), degrees=True)
    T_body_turned = T_body_camera.copy()
    T_body_turned[:3, :3] @= turn.as_matrix()
    return T_body_turned


SMALLEST_SIDE_PX = 2


def resized(camera: Camera, scale: float) -> Camera:
    """The camera with `scale` times as many pixels across, behind the same lens.

    Raises VobenchError for a camera without a focal length, or if the width or height is no whole number.
    """
    if scale == 1:
        return camera
    width_px = nearest_whole(camera.width_px * scale) or 0
    height_px = nearest_whole(camera.height_px * scale) or 0
    if not isinstance(camera, Focal) or min(width_px, height_px) < SMALLEST_SIDE_PX:
        raise VobenchError(
            f"picture_scale {scale:g} needs a focal length and must give a whole width and height, got {camera}"
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


PARALLEL_RAD = 1e-6  # a pair with smaller angles counts as rectified
MAX_TURN_RAD = np.deg2rad(30)  # beyond it the two fields of view hardly overlap


@dataclass(frozen=True, slots=True)
class Rectification:
    """Views from the two optical centres that are parallel to each other and perpendicular to the baseline.

    Both views have the matrix K. A point has the same row in both, and its columns differ by
    K[0, 0] · baseline_m / z.
    """

    K: Array
    baseline_m: float
    R_view_left: Array
    R_view_right: Array

    @property
    def P_left(self) -> Array:
        """The matrix (3, 4) that projects points in metres, in the left view's frame, to its pixels."""
        return projection(self.K, 0.0)

    @property
    def P_right(self) -> Array:
        """The matrix (3, 4) that projects points in metres, in the left view's frame, to the right view's pixels."""
        return projection(self.K, self.baseline_m)


def projection(K: Array, shift_m: float) -> Array:
    """The projection matrix (3, 4) of a pinhole `shift_m` to the right of the frame that points are given in."""
    return np.hstack([K, [[-K[0, 0] * shift_m], [0.0], [0.0]]])


def rectification(rig: Rig) -> Rectification | None:
    """The rectified views of a pair, turned as little as possible; None if no camera is to the right of the left one.

    Their x axis points along the baseline, their z axis as near as possible to the mean of the optical axes.
    Source: Fusiello, Trucco and Verri (2000).
    """
    if rig.right is None:
        return None
    R_left_right = rig.T_left_right[:3, :3]
    baseline_m = rig.T_left_right[:3, 3]
    if baseline_m[0] <= 0:
        return None

    x = unit(baseline_m)
    left_axis = np.array([0.0, 0.0, 1.0])
    right_axis = R_left_right[:, 2]
    ahead = left_axis + right_axis
    z = ahead - (ahead @ x) * x
    if not z.any():
        return None
    z = unit(z)

    R_view_left = np.stack([x, np.cross(z, x), z])
    R_view_right = R_view_left @ R_left_right
    largest_rad = max(float(se3.rotation_angle(R_view_left)), float(se3.rotation_angle(R_view_right)))
    if largest_rad > MAX_TURN_RAD:
        return None
    if largest_rad <= PARALLEL_RAD:
        R_view_left = np.eye(3)
        R_view_right = np.eye(3)
    return Rectification(rig.left.K, rig.baseline_m, R_view_left, R_view_right)
