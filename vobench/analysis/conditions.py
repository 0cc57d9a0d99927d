"""Computes the conditions that make frames of a simulated case difficult, from rays, images and settings."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.image_noise import BLACK_DN, SATURATED_DN
from vobench.geometry import se3
from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.truth import CameraShot, TruthCaster
from vobench.scene.material import Material, linear
from vobench.sensor.image_sensor import CameraSensor
from vobench.sensor.pixel_truth import TruthFrame
from vobench.sensor.response import FULL_SCALE_DN
from vobench.sequence.reader import StereoFrame
from vobench.suite.case import Case
from vobench.trajectory.trajectory import Trajectory

# Every condition of a frame, with its unit and what it is.
CONDITIONS: dict[str, tuple[str, str]] = {
    "mirror": ("%", "pixels on mirrors, or seen through panes"),
    "gloss": ("%", "pixels on glossy coats"),
    "shadow_edge": ("%", "pixels at the edge of a shadow"),
    "moving": ("%", "pixels on moving objects"),
    "burnt": ("%", f"pixels at {SATURATED_DN} or more"),
    "black": ("%", f"pixels at {BLACK_DN} or less"),
    "faintness": ("", "inverse contrast of the textures in view, before the camera's exposure"),
    "depth": ("m", "median distance"),
    "disparity": ("px", "median disparity between the two cameras"),
    "flow": ("px", "median motion of a pixel until the next frame"),
    "turn": ("°", "rotation since the previous frame"),
    "blur": ("px", "standard deviation of motion blur, lens blur and defocus together"),
    "rolling": ("px", "image motion between the first row and the last"),
    "late_images": ("px", "image motion within the delay of the right image and the jitter of both"),
    "compression": ("%", "what the quality of JPEG lacks to 100"),
    "lens_dirt": ("%", "light that dirt on the lens takes"),
    "lens_drops": ("%", "glass before the lens that is covered by drops"),
    "flare": ("%", "light that the lens scatters, or that is in ghosts"),
    "fog": ("%", "light from the median distance that fog takes"),
    "noise": ("DN", "standard deviation of the noise at the mean grey value"),
    "calibration": ("px", "median reprojection error of the nominal calibration"),
    "exposure_jump": ("stops", "change of exposure since the previous frame"),
    "light_jump": ("stops", "change of mean brightness since the previous frame, corrected for exposure"),
    "unlike_eyes": ("stops", "difference of mean brightness between the left and the right image"),
    "missing_frames": ("", "frames missing since the previous one"),
    "darkness": ("", "inverse of the mean grey value of the left image"),
    "short_steps": ("1/m", "inverse of the distance since the previous frame, over which an error is spread"),
    "since_start": ("", "frames since the start"),
}
# What an estimator itself reports of a frame. It is a symptom, so it is never named as a cause.
FEW_TRACKS = "few_tracks"
SYMPTOMS: dict[str, tuple[str, str]] = {
    FEW_TRACKS: ("", "inverse of the number of points that the estimator reports to track"),
}
RAYS_PER_ROW = 60  # about as many pixels of an image row are traced
MIN_STEP_SHARE = 0.1  # of the median step; a shorter step counts as this long
MIN_MEAN_DN = 1.0  # a darker image counts as this bright
MIN_CONTRAST = 0.02  # keeps the faintness of a plain surface finite
MIN_MEAN_REFLECTANCE = 1e-3
RESPONSE_GAMMA = 2.2  # of grey values over the linear signal, approximately
SIGMA_PER_DEFOCUS = 0.25  # standard deviation of a disc over its diameter
SIGMA_PER_SMEAR = 12**-0.5  # standard deviation of a uniform smear over its length
DB_PER_STOP = 20 * np.log10(2)
ONLY_STEP_NS = 1.0  # of a single frame, which has no motion to divide by it

Exposures = Mapping[int, tuple[float, float]]  # exposure time in s and gain in dB, by time stamp


def conditions(
    case: Case,
    gt: Trajectory,
    frames: Iterable[StereoFrame],
    exposures: Exposures,
) -> dict[str, Array]:
    """Compute all CONDITIONS (N,) of the N frames of a simulated case. Shares are from 0 to 1.

    `gt` is the trajectory of the left camera with a pose for each frame.
    """
    observer = _SceneObserver(case)
    steps_ns = _steps_to_next_ns(gt)
    usual_step_ns = float(np.median(np.diff(gt.t_ns))) if len(gt) > 1 else ONLY_STEP_NS
    inverse_steps = _inverse_steps(gt)
    nominal_exposure = (case.camera.exposure_ms / 1e3, case.camera.gain_db)

    rows: list[dict[str, float]] = []
    previous: _FrameState | None = None
    for index, frame in zip(range(len(gt)), frames, strict=False):  # the last frames may have no pose
        shot = CameraShot(gt.T_world_frame[index], frame.t_ns)
        scene_values = observer.conditions(shot, _next_shot(gt, index))

        mean_dn = _mean_dn(frame)
        exposure_s, gain_db = exposures.get(frame.t_ns, nominal_exposure)
        camera_values = _camera_conditions(
            case,
            speed_pxps=scene_values["flow"] / (float(steps_ns[index]) / 1e9),
            depth_m=scene_values["depth"],
            mean_dn=mean_dn,
            exposure_s=exposure_s,
            gain_db=gain_db,
        )

        current = _FrameState(
            exposure_stops=float(np.log2(exposure_s) + gain_db / DB_PER_STOP),
            brightness_stops=_brightness_stops(frame.left),
            T_world_left=gt.T_world_frame[index],
            t_ns=frame.t_ns,
        )
        if previous is None:
            previous = current  # so that the first frame has no changes
        change_values = _changes(previous, current, usual_step_ns)
        previous = current

        frame_values = {
            "darkness": 1 / max(mean_dn, MIN_MEAN_DN),
            "short_steps": float(inverse_steps[index]),
            "since_start": float(index),
        }
        rows.append({**scene_values, **_image_conditions(frame), **camera_values, **change_values, **frame_values})
    return {name: _column(rows, name) for name in CONDITIONS}


def _next_shot(gt: Trajectory, index: int) -> CameraShot:
    """The shot of the next frame; for the last frame, its own."""
    next_index = min(index + 1, len(gt) - 1)
    return CameraShot(gt.T_world_frame[next_index], int(gt.t_ns[next_index]))


def _steps_to_next_ns(gt: Trajectory) -> Array:
    """The time (N,) in ns until the next frame; the last frame has that of the frame before."""
    steps_ns = np.diff(gt.t_ns)
    if not len(steps_ns):
        return np.full(len(gt), ONLY_STEP_NS)
    return np.append(steps_ns, steps_ns[-1]).astype(float)


def _inverse_steps(gt: Trajectory) -> Array:
    """The inverse (N,) in 1/m of the distance from the previous frame; the first frame has that of the second."""
    steps_m = np.diff(gt.distances_m())
    if not len(steps_m) or not steps_m.any():
        return np.zeros(len(gt))
    steps_m = np.append(steps_m[:1], steps_m)
    shortest_m = MIN_STEP_SHARE * np.median(steps_m[steps_m > 0])
    return np.asarray(1 / np.maximum(steps_m, shortest_m))


def _column(rows: list[dict[str, float]], name: str) -> Array:
    return np.array([row[name] for row in rows])


# --- The scene, by rays ---


@dataclass(frozen=True, slots=True)
class SubsampledCamera:
    """A camera with every `step`-th pixel of the rows and columns of another camera."""

    full: Camera
    step: int

    @property
    def width_px(self) -> int:
        """The number of columns."""
        return self.full.width_px // self.step

    @property
    def height_px(self) -> int:
        """The number of rows."""
        return self.full.height_px // self.step

    @property
    def depth_along(self) -> Literal["axis", "ray"]:
        """Whether depth is measured along the optical axis or along the ray, as for the full camera."""
        return self.full.depth_along

    def rays(self, uv_px: Array) -> Array:
        """Unit rays (..., 3) of pixels (..., 2) of this camera."""
        return self.full.rays(uv_px * self.step + self._first_px)

    def project(self, points_camera: Array) -> Array:
        """The pixels (..., 2) of this camera that show points (..., 3)."""
        return (self.full.project(points_camera) - self._first_px) / self.step

    @property
    def _first_px(self) -> float:
        """The pixel of the full camera at the centre of the first pixel of this one."""
        return (self.step - 1) / 2


class _SceneObserver:
    """Observes the scene of a case by rays through a subset of the left camera's pixels."""

    def __init__(self, case: Case) -> None:
        scene = case.build_scene()
        self._nominal_rig = case.build_rig()
        self._true_rig = case.build_true_rig()
        left = self._true_rig.left
        self._camera = SubsampledCamera(left, max(1, left.width_px // RAYS_PER_ROW))
        self._caster = TruthCaster(scene)
        materials = [scene.materials.get(name) for name in self._caster.names.material]
        self._contrast = np.array([_contrast(material) for material in materials])  # (materials,)
        self._is_coated = np.array([bool(material and material.is_coated) for material in materials])
        self._rays = self._camera.rays(pixel_grid(cast("Camera", self._camera)))  # (H, W, 3)

    def conditions(self, now: CameraShot, later: CameraShot) -> dict[str, float]:
        """The conditions that follow from geometry and materials, with the flow to a later shot."""
        channels = ("depth", "flow", "material", "mirror", "shadow", "moving")
        truth = self._caster.frame(cast("Camera", self._camera), now, channels, later=later)
        # A TruthFrame has None for channels that were not requested.
        assert truth.depth is not None
        assert truth.flow is not None
        flow_px = np.linalg.norm(truth.flow, axis=-1) * self._camera.step
        points_m = self._points(truth.depth)
        return {
            **self._pixel_shares(truth),
            "depth": _median(truth.depth),
            "flow": _median(flow_px),
            "disparity": _median(self._disparity_px(points_m)),
            "calibration": _median(self._reprojection_error_px(points_m)),
        }

    def _points(self, depth_m: NDArray[np.float32]) -> Array:
        """The points (N, 3) in the left camera's frame of pixels whose depth (H, W) is finite."""
        axis_share = self._rays[..., 2] if self._camera.depth_along == "axis" else 1.0
        distance_m = depth_m / axis_share
        points_m: Array = (distance_m[..., None] * self._rays)[np.isfinite(depth_m)]
        return points_m

    def _pixel_shares(self, truth: TruthFrame) -> dict[str, float]:
        """The shares of pixels with certain properties, and the faintness of the texture in the image."""
        assert truth.material is not None
        assert truth.mirror is not None
        assert truth.shadow is not None
        assert truth.moving is not None
        material = truth.material
        mirror = truth.mirror
        shadow = truth.shadow
        is_coated = self._is_coated[material]
        is_edge = np.zeros(shadow.shape, bool)
        is_edge[:, 1:] |= shadow[:, 1:] != shadow[:, :-1]
        is_edge[1:] |= shadow[1:] != shadow[:-1]
        return {
            "mirror": float((mirror & ~is_coated).mean()),
            "gloss": float((mirror & is_coated).mean()),
            "shadow_edge": float(is_edge.mean()),
            "faintness": 1 / (MIN_CONTRAST + self._mean_contrast(material)),
            "moving": float(truth.moving.mean()),
        }

    def _mean_contrast(self, material: NDArray[np.uint16]) -> float:
        """The mean contrast over pixels whose material has one; over all materials where there is no such pixel."""
        for contrasts in (self._contrast[material], self._contrast):
            known = contrasts[np.isfinite(contrasts)]
            if known.size:
                return float(known.mean())
        return 0.0

    def _disparity_px(self, points_m: Array) -> Array:
        """The distances (N,) in px between the right camera's pixels of points (N, 3) with and without the baseline."""
        right = self._true_rig.camera("right")
        T_right_left = se3.inverse(self._true_rig.T_left_right)
        at_infinity_px = right.project(points_m @ T_right_left[:3, :3].T)
        shift_px = right.project(se3.apply(T_right_left, points_m)) - at_infinity_px
        return np.asarray(np.linalg.norm(shift_px, axis=-1))

    def _reprojection_error_px(self, points_m: Array) -> Array:
        """The projection errors (N,) of points (N, 3) with the nominal calibration, averaged over both cameras."""
        nominal = self._nominal_rig
        true = self._true_rig
        left_error_px = nominal.left.project(points_m) - true.left.project(points_m)

        in_nominal_right_m = se3.apply(se3.inverse(nominal.T_left_right), points_m)
        in_true_right_m = se3.apply(se3.inverse(true.T_left_right), points_m)
        nominal_right_px = nominal.camera("right").project(in_nominal_right_m)
        right_error_px = nominal_right_px - true.camera("right").project(in_true_right_m)
        left_length_px = np.linalg.norm(left_error_px, axis=-1)
        right_length_px = np.linalg.norm(right_error_px, axis=-1)
        return np.asarray((left_length_px + right_length_px) / 2)


def _contrast(material: Material | None) -> float:
    """The standard deviation of a material's texture divided by its mean.

    NaN without a material, and for mirrors and panes, which show other surfaces.
    """
    if material is None or material.kind != "body":
        return float("nan")
    if material.texture is None:
        return 0.0
    pixels = np.asarray(material.texture.pixels()[::2, ::2])
    is_grey = pixels.ndim == 2
    grey = pixels.astype(np.float32) if is_grey else linear(pixels[..., :3]).mean(-1)
    return float(grey.std() / max(float(grey.mean()), MIN_MEAN_REFLECTANCE))


def _median(values: NDArray[np.floating[Any]]) -> float:
    """The median of finite values; 0 if there are none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else 0.0


# --- The images and the camera ---


def _image_conditions(frame: StereoFrame) -> dict[str, float]:
    """The conditions that the two images show by themselves."""
    left = _grey(frame)
    difference_stops = 0.0
    if frame.right is not None:
        difference_stops = abs(_brightness_stops(frame.left) - _brightness_stops(frame.right))
    return {
        "burnt": float((left >= SATURATED_DN).mean()),
        "black": float((left <= BLACK_DN).mean()),
        "unlike_eyes": difference_stops,
    }


def _grey(frame: StereoFrame) -> NDArray[np.float32]:
    """The left image (H, W) in grey values."""
    left = frame.left.astype(np.float32)
    return left.mean(-1) if left.ndim == 3 else left


def _mean_dn(frame: StereoFrame) -> float:
    return float(_grey(frame).mean())


def _brightness_stops(image: Any) -> float:
    """The mean of an image in stops of the linear signal, approximately."""
    return float(RESPONSE_GAMMA * np.log2(max(float(image.mean()), 1.0)))


def _camera_conditions(
    case: Case,
    *,
    speed_pxps: float,
    depth_m: float,
    mean_dn: float,
    exposure_s: float,
    gain_db: float,
) -> dict[str, float]:
    """The conditions that follow from the settings of camera and weather, with what the frame shows."""
    camera = case.camera
    motion_sigma_px = SIGMA_PER_SMEAR * speed_pxps * exposure_s * camera.motion_blur
    lens_sigma_px = camera.blur_sigma_px
    defocus_sigma_px = SIGMA_PER_DEFOCUS * camera.defocus_px
    blur_px = np.sqrt(motion_sigma_px**2 + lens_sigma_px**2 + defocus_sigma_px**2)
    timing = camera.timing
    late_s = (abs(timing.right_delay_ms) + timing.jitter_ms) / 1e3
    fog = case.scene.fog
    missing_quality = 0 if camera.jpeg_quality is None else 100 - camera.jpeg_quality
    return {
        "blur": float(blur_px),
        "rolling": speed_pxps * camera.readout_s,
        "late_images": speed_pxps * late_s,
        "compression": missing_quality / 100,
        "lens_dirt": camera.dirt,
        "lens_drops": camera.lens_drops,
        "flare": camera.flare + camera.ghost,
        "fog": 1 - float(fog.transmittance(np.array(depth_m))) if fog else 0.0,
        "noise": chip_noise_dn(camera.chip, mean_dn, gain_db=gain_db),
    }


MIN_SIGNAL_STEP = 1e-9  # of the full well; avoids a division by zero where the response is flat


def chip_noise_dn(chip: CameraSensor, grey_dn: float, *, gain_db: float = 0.0) -> float:
    """The temporal noise of a chip at a grey value. Source: EMVA 1288, release 3.1, eq. 10."""
    amplification = 10 ** (gain_db / 20)
    neighbours_dn = np.array([grey_dn - 1, grey_dn + 1])
    grey_low, grey_high = np.clip(neighbours_dn, 0, FULL_SCALE_DN) / FULL_SCALE_DN
    # The signals that these grey values encode, as shares of the full well.
    signal_low, signal_high = chip.curve.decode(np.array([grey_low, grey_high]))
    electrons = (signal_low + signal_high) / 2 * chip.full_well_e / amplification
    shot_variance_e = chip.shot_noise * electrons
    sigma_e = np.sqrt(chip.read_noise_e**2 + shot_variance_e)
    grey_step_dn = (grey_high - grey_low) * FULL_SCALE_DN
    signal_step = max(signal_high - signal_low, MIN_SIGNAL_STEP)
    slope_dn = grey_step_dn / signal_step  # grey values per full well
    return float(slope_dn * sigma_e * amplification / chip.full_well_e)


# --- Changes since the previous frame ---


@dataclass(frozen=True, slots=True)
class _FrameState:
    """The properties of a frame that are compared with those of the next frame."""

    exposure_stops: float
    brightness_stops: float
    T_world_left: Array
    t_ns: int


def _changes(previous: _FrameState, current: _FrameState, usual_step_ns: float) -> dict[str, float]:
    """The conditions that compare a frame with the previous one; the first frame is compared with itself."""
    exposure_change = current.exposure_stops - previous.exposure_stops
    brightness_change = current.brightness_stops - previous.brightness_stops
    R_world_previous = previous.T_world_left[:3, :3]
    R_previous_current = R_world_previous.T @ current.T_world_left[:3, :3]
    steps = (current.t_ns - previous.t_ns) / usual_step_ns
    return {
        "exposure_jump": abs(exposure_change),
        "light_jump": abs(brightness_change - exposure_change),
        "turn": float(np.rad2deg(se3.rotation_angle(R_previous_current[None])[0])),
        "missing_frames": max(0.0, round(steps) - 1.0),
    }
