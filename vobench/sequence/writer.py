"""Writing a sequence: a folder with what an estimator may see, and apart from it the truth."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.rig import Rig, Side, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.sensor.truth import TruthFrame, TruthNames, check_channels
from vobench.sequence import messages as ros
from vobench.sequence.bag import BagWriter
from vobench.sequence.truth_image import check_truth, names_to_json, truth_image, truth_topic, truth_topics

SENSORS_FILE, TRUTH_FILE = "sensors.mcap", "truth.mcap"
WHEELS_NOTE, CASE_ATTACHMENT, NAMES_ATTACHMENT = "vobench.wheels", "case.json", "truth_names.json"

Image = NDArray[np.uint8]


class SequenceWriter:
    """Streams a recording into `folder`; both files appear when the context ends without an error.

    Stamps are `t_ns`, int64, from 0. Calls come in order of time: the encoder readings up to a
    frame's stamp before that frame. The case goes with the truth, for it holds seeds and path,
    and so does `true_rig`, where it is not the `rig` that estimators are told, and what is true of pixels.
    Pictures are PNG, without loss, or JPEG of a quality from 1 to 100.
    Raises SequenceError where stamps fall, or pictures or poses are not what the rig says.
    """

    def __init__(
        self,
        folder: Path,
        rig: Rig,
        *,
        case_json: bytes,
        true_rig: Rig | None = None,
        jpeg_quality: int | None = None,
        truth_channels: Sequence[str] = (),
        truth_names: TruthNames | None = None,
    ) -> None:
        self._rig, self._true_rig, self._channels = rig, true_rig or rig, check_channels(truth_channels)
        self._jpeg_quality = jpeg_quality
        self._stack = ExitStack()
        folder.mkdir(parents=True, exist_ok=True)
        topics = (*ros.TRUTH_TOPICS, *ros.TRUE_INFO_TOPICS, *truth_topics(self._channels))
        self._truth = self._stack.enter_context(BagWriter(folder / TRUTH_FILE, topics))
        self._sensors = self._stack.enter_context(BagWriter(folder / SENSORS_FILE, ros.SENSOR_TOPICS))
        self._truth.attach(CASE_ATTACHMENT, "application/json", case_json)
        if self._channels:
            names = names_to_json(truth_names or TruthNames())
            self._truth.attach(NAMES_ATTACHMENT, "application/json", names)
        for bag, its_rig in ((self._sensors, rig), (self._truth, true_rig or rig)):
            if its_rig.wheels:
                bag.note(WHEELS_NOTE, _wheel_entries(its_rig.wheels))
            bag.write(ros.TF_STATIC, 0, ros.mounts(its_rig))
        for topic, info in zip(ros.TRUE_INFO_TOPICS, ros.stereo_info(0, true_rig or rig), strict=True):
            self._truth.write(topic, 0, info)

    def write_frame(self, t_ns: int, left: Image, right: Image) -> None:
        """Add a stereo pair, (H, W) uint8 each, with its calibration."""
        rig, bag = self._rig, self._sensors
        form = "png" if self._jpeg_quality is None else "jpeg"
        encoded = [
            encode(picture, camera, name, jpeg_quality=self._jpeg_quality)
            for picture, camera, name in ((left, rig.left, ros.LEFT), (right, rig.camera("right"), ros.RIGHT))
        ]
        for topic, info in zip((ros.LEFT_INFO, ros.RIGHT_INFO), ros.stereo_info(t_ns, rig), strict=True):
            bag.write(topic, t_ns, info)
        bag.write(ros.LEFT_IMAGE, t_ns, ros.image(t_ns, ros.LEFT, encoded[0], form))
        bag.write(ros.RIGHT_IMAGE, t_ns, ros.image(t_ns, ros.RIGHT, encoded[1], form))

    def write_exposure(self, t_ns: int, time_s: float, gain_db: float) -> None:
        """Add how the stereo pair of that stamp was exposed."""
        self._sensors.write(ros.EXPOSURE, t_ns, ros.exposure(t_ns, time_s, gain_db))

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

    def write_truth_frame(self, t_ns: int, side: Side, frame: TruthFrame) -> None:
        """Add what is true of every pixel of one camera's picture: the channels that the writer was opened for."""
        check_truth(frame, self._channels, self._true_rig.camera(side), side)
        for channel, values in frame.channels().items():
            self._truth.write(truth_topic(side, channel), t_ns, truth_image(t_ns, side, channel, values))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)


def _wheel_entries(wheels: WheelGeometry) -> dict[str, str]:
    return {
        "radius_m": repr(float(wheels.radius_m)),
        "track_m": repr(float(wheels.track_m)),
        "ticks_per_revolution": str(wheels.ticks_per_revolution),
    }


def encode(image: Image, camera: Camera, name: str, *, jpeg_quality: int | None = None) -> bytes:
    """A grey picture as PNG, or as JPEG of a quality. Raises SequenceError where it is not what the camera takes.

    PNG gets no compression level: OpenCV's default strategy is both faster and smaller than any level.
    """
    if image.shape != (camera.height_px, camera.width_px) or image.dtype != np.uint8:
        raise SequenceError(
            f"{name} takes ({camera.height_px}, {camera.width_px}) uint8 pictures, got {image.shape} {image.dtype}"
        )
    if jpeg_quality is None:
        return cv2.imencode(".png", image)[1].tobytes()
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality])[1].tobytes()
