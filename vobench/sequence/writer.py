"""Writing a sequence: a folder with what an estimator may see, and apart from it the truth."""

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.sequence import messages as ros
from vobench.sequence.bag import BagWriter

SENSORS_FILE, TRUTH_FILE = "sensors.mcap", "truth.mcap"
WHEELS_NOTE, CASE_ATTACHMENT = "vobench.wheels", "case.json"

Image = NDArray[np.uint8]


class SequenceWriter:
    """Streams a recording into `folder`; both files appear when the context ends without an error.

    Stamps are `t_ns`, int64, from 0. Calls come in order of time: the encoder readings up to a
    frame's stamp before that frame. The case goes with the truth, for it holds seeds and path.
    Raises SequenceError where stamps fall, or pictures or poses are not what the rig says.
    """

    def __init__(self, folder: Path, rig: Rig, *, case_json: bytes) -> None:
        self._rig = rig
        self._stack = ExitStack()
        folder.mkdir(parents=True, exist_ok=True)
        self._truth = self._stack.enter_context(BagWriter(folder / TRUTH_FILE, ros.TRUTH_TOPICS))
        self._sensors = self._stack.enter_context(BagWriter(folder / SENSORS_FILE, ros.SENSOR_TOPICS))
        self._truth.attach(CASE_ATTACHMENT, "application/json", case_json)
        self._sensors.note(WHEELS_NOTE, _wheel_entries(rig))
        for bag in (self._sensors, self._truth):
            bag.write(ros.TF_STATIC, 0, ros.mounts(rig))

    def write_frame(self, t_ns: int, left: Image, right: Image) -> None:
        """Add a stereo pair, (H, W) uint8 each, with its calibration."""
        rig, bag = self._rig, self._sensors
        left_png, right_png = encode_png(left, rig.left, ros.LEFT), encode_png(right, rig.right, ros.RIGHT)
        bag.write(ros.LEFT_INFO, t_ns, ros.camera_info(t_ns, ros.LEFT, rig.left))
        right_info = ros.camera_info(t_ns, ros.RIGHT, rig.right, shift_m=rig.baseline_m)
        bag.write(ros.RIGHT_INFO, t_ns, right_info)
        bag.write(ros.LEFT_IMAGE, t_ns, ros.png_image(t_ns, ros.LEFT, left_png))
        bag.write(ros.RIGHT_IMAGE, t_ns, ros.png_image(t_ns, ros.RIGHT, right_png))

    def write_encoders(self, t_ns: ArrayLike, ticks: ArrayLike) -> None:
        """Add encoder readings: stamps (M,) and counts (M, 2) int64, left and right."""
        stamps, counts = np.asarray(t_ns, np.int64), np.asarray(ticks, np.int64)
        for t, (left, right) in zip(stamps.tolist(), counts.reshape(-1, 2).tolist(), strict=True):
            self._sensors.write(ros.ENCODERS, t, ros.wheel_ticks(t, left, right))

    def write_truth(self, t_ns: int, T_world_body: Array, twist_body: ArrayLike) -> None:
        """Add the body's true pose (4, 4) and its twist (6,), linear m/s then angular rad/s, in body axes."""
        if not (se3.is_rotation(T_world_body[:3, :3]) and np.isfinite(T_world_body).all()):
            raise SequenceError(f"the true pose at {t_ns} ns is no rigid transform: {T_world_body.tolist()}")
        self._truth.write(ros.TF, t_ns, ros.transforms(t_ns, ros.WORLD, {ros.BODY: T_world_body}))
        self._truth.write(ros.ODOMETRY, t_ns, ros.odometry(t_ns, T_world_body, twist_body))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)


def _wheel_entries(rig: Rig) -> dict[str, str]:
    wheels = rig.wheels
    return {
        "radius_m": repr(float(wheels.radius_m)),
        "track_m": repr(float(wheels.track_m)),
        "ticks_per_revolution": str(wheels.ticks_per_revolution),
    }


def encode_png(image: Image, camera: Pinhole, name: str) -> bytes:
    """A grey picture as PNG. Raises SequenceError where it is not what the camera takes.

    No compression level is passed: OpenCV's default strategy is both faster and smaller than any level.
    """
    if image.shape != (camera.height_px, camera.width_px) or image.dtype != np.uint8:
        raise SequenceError(
            f"{name} takes ({camera.height_px}, {camera.width_px}) uint8 pictures, got {image.shape} {image.dtype}"
        )
    return cv2.imencode(".png", image)[1].tobytes()
