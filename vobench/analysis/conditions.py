"""What makes each frame of a case hard, as only its simulator knows: by rays, from the pictures and from settings."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.truth import Shot, TruthCaster
from vobench.scene.material import Material, linear
from vobench.sensor.image_sensor import CameraSensor
from vobench.sensor.pixel_truth import TruthFrame
from vobench.sensor.response import FULL_SCALE_DN
from vobench.sequence.reader import StereoFrame
from vobench.suite.suite import Case
from vobench.trajectory.trajectory import Trajectory

# What there is to know of a frame, each with its unit and what it is.
CONDITIONS: dict[str, tuple[str, str]] = {
    "mirror": ("%", "pixels on mirrors, or seen through panes"),
    "gloss": ("%", "pixels on coats that mirror"),
    "shadow_edge": ("%", "pixels at the edge of a shadow"),
    "moving": ("%", "pixels on things that move"),
    "burnt": ("%", "pixels at 254 or more"),
    "black": ("%", "pixels at 2 or less"),
    "faintness": ("", "one over the contrast of the textures in view, whatever the camera makes of them"),
    "depth": ("m", "the middle distance"),
    "disparity": ("px", "the middle one between the eyes"),
    "flow": ("px", "how far the middle pixel goes to the next frame"),
    "turn": ("°", "rotation since the frame before"),
    "blur": ("px", "the smear of motion, lens and focus together"),
    "rolling": ("px", "what moves between the first row and the last"),
    "noise": ("DN", "its standard deviation at the picture's mean"),
    "calibration": ("px", "between where a point is and where the calibration has it"),
    "exposure_jump": ("stops", "between this frame's exposure and the last one's"),
    "light_jump": ("stops", "between this picture's mean and the last one's, the exposure taken out"),
    "unlike_eyes": ("stops", "between the left picture's mean and the right one's"),
    "missing_frames": ("", "frames that are not there since the last one"),
}
SAMPLES_ACROSS = 60  # pixels that rays are cast through, in a row of the picture
BURNT_DN = 254
BLACK_DN = 2
LEAST_CONTRAST = 0.02
BLUR_PER_DEFOCUS = 0.25  # standard deviation of a disc over its diameter
SIGMA_PER_SMEAR = 12**-0.5  # of an even smear over its length


@dataclass(frozen=True, slots=True)
class Sampled:
    """Every `step`-th pixel of a camera's rows and columns, as a camera."""

    of: Camera
    step: int

    @property
    def width_px(self) -> int:
        """How many pixels a row has."""
        return self.of.width_px // self.step

    @property
    def height_px(self) -> int:
        """How many rows there are."""
        return self.of.height_px // self.step

    @property
    def depth_along(self) -> Literal["axis", "ray"]:
        """As of the whole camera."""
        return self.of.depth_along

    def rays(self, uv_px: Array) -> Array:
        """The rays of its pixels."""
        return self.of.rays(uv_px * self.step + (self.step - 1) / 2)

    def project(self, points_camera: Array) -> Array:
        """Where points are in its pixels."""
        return (self.of.project(points_camera) - (self.step - 1) / 2) / self.step


Exposures = Mapping[int, tuple[float, float]]


def conditions(case: Case, gt: Trajectory, frames: Iterable[StereoFrame], exposures: Exposures) -> dict[str, Array]:
    """All of CONDITIONS (N,) of a simulated case's frames; shares from 0 to 1.

    `gt` is the left camera's path with a pose for each frame; `exposures` are time_s and gain_db by stamp.
    """
    watched = _Watched(case)
    rows = list[dict[str, float]]()
    before = None
    steps_ns = np.diff(gt.t_ns)
    usual_ns = float(np.median(steps_ns)) if len(steps_ns) else 1.0
    for frame, T, nth in zip(frames, gt.T_world_frame, range(len(gt)), strict=False):
        later = min(nth + 1, len(gt) - 1)
        row = watched.seen(Shot(T, frame.t_ns), Shot(gt.T_world_frame[later], int(gt.t_ns[later])))
        exposure_s, gain_db = exposures.get(frame.t_ns, (case.camera.exposure_ms / 1e3, case.camera.gain_db))
        row |= _pictured(frame)
        step_s = (float(steps_ns[min(nth, len(steps_ns) - 1)]) if len(steps_ns) else usual_ns) / 1e9
        row |= _set(case, row, exposure_s=exposure_s, gain_db=gain_db, step_s=step_s)
        stops = np.log2(exposure_s) + gain_db / (20 * np.log10(2))
        since = (stops, row.pop("level"), T, frame.t_ns)
        row |= _since(before or since, since, usual_ns)
        before = since
        rows.append(row)
    return {name: np.array([row[name] for row in rows]) for name in CONDITIONS}


class _Watched:
    """A case's scene seen by rays through some of the left camera's pixels."""

    def __init__(self, case: Case) -> None:
        scene = case.build_scene()
        self._told = case.build_rig()
        self._true = case.build_true_rig()
        self._camera = Sampled(self._true.left, max(1, self._true.left.width_px // SAMPLES_ACROSS))
        self._caster = TruthCaster(scene)
        looks = [scene.materials.get(name) for name in self._caster.names.material]
        self._contrast = np.array([np.nan if look is None else _contrast(look) for look in looks])
        self._is_coated = np.array([look is not None and look.is_coated for look in looks])
        self._rays = self._camera.rays(pixel_grid(cast("Camera", self._camera)))

    def seen(self, now: Shot, later: Shot) -> dict[str, float]:
        channels = ("depth", "flow", "material", "mirror", "shadow", "moving")
        truth = self._caster.frame(cast("Camera", self._camera), now, channels, later=later)
        assert truth.depth is not None and truth.flow is not None  # noqa: PT018 - both were asked for
        shares = self._shares(truth)
        known = np.isfinite(truth.depth)
        flow_px = np.linalg.norm(truth.flow, axis=-1) * self._camera.step
        lengths = truth.depth / (self._rays[..., 2] if self._camera.depth_along == "axis" else 1.0)
        points_m = (lengths[..., None] * self._rays)[known]
        return shares | {
            "depth": _middle(truth.depth),
            "flow": _middle(flow_px),
            "disparity": _middle(self._disparity_px(points_m)),
            "calibration": _middle(self._off_px(points_m)),
        }

    def _shares(self, truth: TruthFrame) -> dict[str, float]:
        material = cast("Any", truth.material)
        mirror = cast("Any", truth.mirror)
        shadow = cast("Any", truth.shadow)
        coated = self._is_coated[material]
        edge = np.zeros(shadow.shape, bool)
        edge[:, 1:] |= shadow[:, 1:] != shadow[:, :-1]
        edge[1:] |= shadow[1:] != shadow[:-1]
        return {
            "mirror": float((mirror & ~coated).mean()),
            "gloss": float((mirror & coated).mean()),
            "shadow_edge": float(edge.mean()),
            "faintness": 1 / (LEAST_CONTRAST + self._seen_contrast(material)),
            "moving": float(cast("Any", truth.moving).mean()),
        }

    def _seen_contrast(self, material: NDArray[np.uint16]) -> float:
        """The mean over pixels of things with a texture; of all things, where none is in view."""
        for values in (self._contrast[material], self._contrast):
            if (known := values[np.isfinite(values)]).size:
                return float(known.mean())
        return 0.0

    def _disparity_px(self, points_m: Array) -> Array:
        right = self._true.camera("right")
        T = se3.inverse(self._true.T_left_right)
        moved = right.project(se3.apply(T, points_m)) - right.project(points_m @ T[:3, :3].T)
        return np.asarray(np.linalg.norm(moved, axis=-1))

    def _off_px(self, points_m: Array) -> Array:
        """The mean over both eyes of how far a point is from where it is said to be."""
        left = self._told.left.project(points_m) - self._true.left.project(points_m)
        right = [
            rig.camera("right").project(se3.apply(se3.inverse(rig.T_left_right), points_m))
            for rig in (self._told, self._true)
        ]
        return np.asarray((np.linalg.norm(left, axis=-1) + np.linalg.norm(right[0] - right[1], axis=-1)) / 2)


def _contrast(look: Material) -> float:
    """The spread of a material's texture over its mean; NaN for a mirror or a pane, which shows other things."""
    if look.kind != "body":
        return float("nan")
    if look.texture is None:
        return 0.0
    pixels = np.asarray(look.texture.pixels()[::2, ::2])
    grey = pixels.astype(np.float32) if pixels.ndim == 2 else linear(pixels[..., :3]).mean(-1)
    return float(grey.std() / max(float(grey.mean()), 1e-3))


def _middle(values: NDArray[np.floating[Any]]) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else 0.0


def _pictured(frame: StereoFrame) -> dict[str, float]:
    """What pictures show; `level` is the left one's mean in stops of the linear signal, roughly."""
    left = frame.left.astype(np.float32)
    left = left.mean(-1) if left.ndim == 3 else left
    level = _level(frame.left)
    return {
        "burnt": float((left >= BURNT_DN).mean()),
        "black": float((left <= BLACK_DN).mean()),
        "unlike_eyes": 0.0 if frame.right is None else abs(level - _level(frame.right)),
        "level": level,
        "mean": float(left.mean()),
    }


def _level(picture: Any) -> float:
    return float(2.2 * np.log2(max(float(picture.mean()), 1.0)))


def _set(case: Case, row: dict[str, float], *, exposure_s: float, gain_db: float, step_s: float) -> dict[str, float]:
    """What follows from the camera's settings and how fast the picture flows."""
    camera = case.camera
    speed_pxps = row["flow"] / step_s
    smear = SIGMA_PER_SMEAR * speed_pxps * exposure_s * camera.motion_blur
    blur = np.sqrt(smear**2 + camera.blur_sigma_px**2 + (BLUR_PER_DEFOCUS * camera.defocus_px) ** 2)
    return {
        "blur": float(blur),
        "rolling": speed_pxps * camera.readout_s,
        "noise": chip_noise_dn(camera.chip, row["mean"], gain_db=gain_db),
    }


def chip_noise_dn(chip: CameraSensor, grey_dn: float, *, gain_db: float = 0.0) -> float:
    """The temporal noise of a chip at a grey value. Source: EMVA 1288, release 3.1, eq. 10."""
    amplification = 10 ** (gain_db / 20)
    around = np.clip(np.array([grey_dn - 1, grey_dn + 1]), 0, FULL_SCALE_DN) / FULL_SCALE_DN
    low, high = chip.curve.decode(around)
    electrons = (low + high) / 2 * chip.full_well_e / amplification
    sigma_e = np.sqrt(chip.read_noise_e**2 + chip.shot_noise * electrons)
    slope = (around[1] - around[0]) * FULL_SCALE_DN / max(high - low, 1e-9)
    return float(slope * sigma_e * amplification / chip.full_well_e)


Before = tuple[float, float, Array, int]


def _since(before: Before, now: Before, usual_ns: float) -> dict[str, float]:
    exposure_jump = now[0] - before[0]
    turned_rad = se3.rotation_angle((before[2][:3, :3].T @ now[2][:3, :3])[None])[0]
    gap = (now[3] - before[3]) / usual_ns
    return {
        "exposure_jump": abs(exposure_jump),
        "light_jump": abs(now[1] - before[1] - exposure_jump),
        "turn": float(np.rad2deg(turned_rad)),
        "missing_frames": max(0.0, round(gap) - 1.0),
    }
