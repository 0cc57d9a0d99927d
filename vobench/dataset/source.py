"""A sequence as the writers of layouts see it, and the test that what they wrote says the same.

The test sends known points and the true path through what was read back as through the sequence.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole, pixel_grid
from vobench.geometry.rig import Rig, Side, rectification, side_by_side
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuBias, ImuReadings
from vobench.sequence import (
    Sequence,
    has_truth,
    read_case,
    read_imu_bias,
    read_true_rig,
    read_truth,
    read_twist,
    truth_channels,
)
from vobench.sequence.picture import Image, decode, encode
from vobench.trajectory.trajectory import Stamps, Trajectory

FAR_PX = 30_000.0  # outside of any picture that OpenCV resamples, which takes NaN for any place
PIXEL_TOLERANCE = 1e-6
POSE_TOLERANCE = 1e-9  # metres, and entries of rotations
DEPTHS_M = (0.3, 1.0, 5.0, 30.0, 1000.0)
GRID = 9  # points across a picture and down it


@dataclass(frozen=True, slots=True)
class Views:
    """The rig of some pictures, and where their pixels (H, W, 2) lie in the recorded ones; None: as recorded."""

    rig: Rig
    source_px: dict[Side, Array] | None = None

    def rays_of(self, side: Side, camera: Camera) -> Array:
        """Directions (H, W, 3) that light came from, in the axes of the camera that recorded; NaN for none."""
        pixels = self.source_px[side] if self.source_px else pixel_grid(camera)
        return camera.rays(pixels)

    def show(self, side: Side, picture: Image) -> Image:
        """A recorded picture in this view: linear between its pixels, black where it shows nothing."""
        if self.source_px is None:
            return picture
        places = np.clip(np.nan_to_num(self.source_px[side], nan=-FAR_PX), -FAR_PX, FAR_PX).astype(np.float32)
        u, v = np.moveaxis(places, -1, 0)
        shown = cv2.remap(picture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return shown.astype(np.uint8, copy=False)

    def dark_share(self, side: Side, recorded: Camera) -> float:
        """The share of this view's pixels that lie outside the recorded picture."""
        if self.source_px is None:
            return 0.0
        last = (recorded.width_px - 1, recorded.height_px - 1)
        inside = (self.source_px[side] >= 0) & (self.source_px[side] <= last)
        return 1.0 - float(inside.all(-1).mean())


def rectified(rig: Rig) -> Views:
    """The pinholes side by side that stand for a rig, or the rig where it is that. Raises SequenceError for no pair."""
    flat, turns = _flat(rig)
    if pixel_difference(rig, flat) < PIXEL_TOLERANCE:
        return Views(flat)
    rays = flat.left.rays(pixel_grid(flat.left))
    return Views(flat, {side: rig.camera(side).project(rays @ turns[side]) for side in rig.sides})


def _flat(rig: Rig) -> tuple[Rig, dict[Side, Array]]:
    """The pinholes, and nothing else that the rig has; and how each of them is turned: R_view_camera."""
    views = rectification(rig)
    if rig.right and views is None:
        raise SequenceError(
            "the right camera is not to the right of the left one and looking the same way, so nothing rectifies "
            "the pair as KITTI needs it; euroc and ros2 keep it as it is"
        )
    R_view_left = views.R_view_left if views else np.eye(3)
    K = rig.left.K
    hole = Pinhole(rig.left.width_px, rig.left.height_px, *K[[0, 1, 0, 1], [0, 1, 2, 2]].tolist())
    T_body_left = rig.T_body_left @ se3.transform(R_view_left.T, np.zeros(3))
    if views is None:
        return Rig(hole, None, T_body_left, None), {"left": R_view_left}
    T_body_right = T_body_left @ side_by_side(views.baseline_m)
    return Rig(hole, hole, T_body_left, T_body_right), {"left": R_view_left, "right": views.R_view_right}


PNG = "png"


@dataclass(frozen=True, slots=True)
class ExportSource:
    """What there is to export; None for what was not recorded.

    `truth` is the path of the body, `twist` (N, 6) its velocities in its own axes, linear m/s and angular rad/s.
    """

    folder: Path
    sequence: Sequence
    true_rig: Rig
    truth: Trajectory | None = None
    twist: Array | None = None
    bias: ImuBias | None = None
    imu: ImuReadings | None = None
    channels: tuple[str, ...] = ()
    case: Mapping[str, Any] | None = None

    @property
    def rig(self) -> Rig:
        """The rig as estimators are told it; an IMU without a reading is none."""
        return self.sequence.rig if self.imu else replace(self.sequence.rig, imu=None)


@dataclass(frozen=True, slots=True)
class PngFrame:
    """The pictures of one instant as PNG files, by the side of their camera."""

    index: int
    t_ns: int
    pictures: dict[Side, bytes]


def open_source(folder: Path) -> ExportSource:
    """Look into a sequence's two files. Raises SequenceError where they are not whole."""
    sequence = Sequence.open(folder)
    imu = sequence.imu()
    readings = imu if len(imu.t_ns) else None
    if not has_truth(folder):
        return ExportSource(folder, sequence, sequence.rig, imu=readings)
    truth = read_truth(folder)
    bias = read_imu_bias(folder)
    return ExportSource(
        folder,
        sequence,
        read_true_rig(folder),
        truth if len(truth) else None,
        read_twist(folder),
        bias if len(bias.t_ns) else None,
        readings,
        truth_channels(folder),
        _case(folder),
    )


def _case(folder: Path) -> Mapping[str, Any] | None:
    try:
        case = json.loads(read_case(folder))
    except SequenceError:
        return None
    return case if isinstance(case, dict) else None


def png_frames(sequence: Sequence, views: Views) -> Iterator[PngFrame]:
    """The pictures as a layout shows them; bytes that are PNG already pass as they are."""
    for frame in sequence.encoded_frames():
        found: dict[Side, bytes | None] = {"left": frame.left, "right": frame.right}
        shown = {side: _shown(sequence.rig, views, side, found[side], frame.form) for side in views.rig.sides}
        yield PngFrame(frame.index, frame.t_ns, shown)


def _shown(rig: Rig, views: Views, side: Side, encoded: bytes | None, form: str) -> bytes:
    if encoded is None:
        raise SequenceError(f"a frame has no {side} picture, and the rig says there is one")
    if views.source_px is None and form == PNG:
        return bytes(encoded)
    picture = views.show(side, decode(encoded, rig.camera(side), f"a {side} picture"))
    return encode(picture, views.rig.camera(side), side)


def rate_hz(t_ns: Stamps) -> float:
    """How often something was recorded, on average; 0 for a single time."""
    span_ns = int(t_ns[-1]) - int(t_ns[0]) if len(t_ns) > 1 else 0
    return (len(t_ns) - 1) * 1e9 / span_ns if span_ns else 0.0


def known_points(camera: Camera) -> Array:
    """Points (N, 3) before a camera, evenly over its picture and at several depths."""
    u, v = (np.linspace(0, size - 1, GRID) for size in (camera.width_px, camera.height_px))
    pixels = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    rays = camera.rays(pixels)
    seen = rays[np.isfinite(rays).all(1)]
    points: Array = (seen * np.array(DEPTHS_M)[:, None, None]).reshape(-1, 3)
    return points


def pixel_difference(expected: Rig, found: Rig) -> float:
    """The largest distance in px between two rigs' views of the same points; infinite for other pictures."""
    if expected.sides != found.sides:
        return np.inf
    points = known_points(expected.left)
    largest = 0.0
    for side in expected.sides:
        cameras = expected.camera(side), found.camera(side)
        if len({(camera.width_px, camera.height_px) for camera in cameras}) > 1:
            return np.inf
        pixels = [_seen_from_left(rig, points, right=side == "right") for rig in (expected, found)]
        largest = max(largest, _largest(pixels[0], pixels[1]))
    return largest


def _seen_from_left(rig: Rig, points_left: Array, *, right: bool) -> Array:
    if not right:
        return rig.left.project(points_left)
    return rig.camera("right").project(se3.apply(se3.inverse(rig.T_left_right), points_left))


def _largest(expected: Array, found: Array) -> float:
    blind = np.isnan(expected[:, 0])
    if not (~blind).any():
        return np.inf
    off = np.linalg.norm(expected[~blind] - found[~blind], axis=-1)
    return float(off.max()) if np.isfinite(off).all() else np.inf


def check_rig(what: str, expected: Rig, found: Rig) -> None:
    """Raises SequenceError unless a rig that was read back sends known points where the exported one does."""
    off = pixel_difference(expected, found)
    if not off < PIXEL_TOLERANCE:
        raise SequenceError(
            f"{what} does not say what was exported: known points come to lie {off:.3g} px beside their place, "
            f"and {PIXEL_TOLERANCE:g} px would be right"
        )
    if expected.imu and found.imu:
        mounts = ((expected, expected.imu), (found, found.imu))
        off = _pose_difference(*(se3.inverse(rig.T_body_left) @ imu.T_body_imu for rig, imu in mounts))
        if not off < POSE_TOLERANCE:
            raise SequenceError(
                f"{what} puts the IMU {off:.3g} beside its place, and {POSE_TOLERANCE:g} would be right"
            )


def check_path(what: str, expected: Trajectory, found: Trajectory) -> None:
    """Raises SequenceError unless a path that was read back has the same stamps, and poses to 1e-9."""
    if not np.array_equal(expected.t_ns, found.t_ns):
        raise SequenceError(f"{what} has other stamps than were exported: {_first_stamps(expected, found)}")
    off = _pose_difference(expected.T_world_frame, found.T_world_frame)
    if not off < POSE_TOLERANCE:
        raise SequenceError(f"{what} has poses {off:.3g} beside those exported, and {POSE_TOLERANCE:g} would be right")


def _pose_difference(expected: Array, found: Array) -> float:
    return float(np.abs(expected - found).max(initial=0.0))


def _first_stamps(expected: Trajectory, found: Trajectory) -> str:
    if len(expected) != len(found):
        return f"{len(found)} of {len(expected)}"
    at = int(np.flatnonzero(expected.t_ns != found.t_ns)[0])
    return f"pose {at} at {found.t_ns[at]} ns and not {expected.t_ns[at]} ns"
