"""Writing a sequence: a folder with one file that an estimator may see, and another one with the truth."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from vobench import stop
from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.rig import Rig, Side
from vobench.geometry.se3 import Array
from vobench.sensor.imu import ImuReadings
from vobench.sensor.pixel_truth import TruthFrame, TruthNames, check_channels
from vobench.sequence.bag_writer import BagWriter
from vobench.sequence.calibration import write_mounts
from vobench.sequence.camera_info import camera_info_messages
from vobench.sequence.cdr import serialise, with_picture, with_stamp
from vobench.sequence.message import (
    image_message,
    imu_message,
    odometry_message,
    stamped_message,
    tf_message,
    vector_message,
)
from vobench.sequence.picture import MONO, Image, encode, require_picture
from vobench.sequence.pixel_truth import check_truth, names_to_json, pixel_truth_topics, truth_image, truth_topic
from vobench.sequence.topic import (
    BODY,
    CASE_ATTACHMENT,
    DISTURBANCE,
    ENCODERS,
    EXPOSURE,
    IMAGE_TOPICS,
    IMPORT_NOTE,
    IMU,
    IMU_BIAS,
    IMU_FRAME,
    INFO_TOPICS,
    LEFT,
    NAMES_ATTACHMENT,
    ODOMETRY,
    PROVENANCE_NOTE,
    RIGHT,
    SENSORS_FILE,
    TF,
    TRUE_INFO_TOPICS,
    TRUTH_FILE,
    WORLD,
    sensor_topics,
    truth_topics,
)

NAMES = (LEFT, RIGHT)

T = TypeVar("T")


class SequenceWriter:
    """Streams a recording into `folder`; both files appear when the context ends without an error.

    Stamps are `t_ns`, int64; what never changes is stamped `start_ns`. Calls come in order of time: readings up to a
    frame's stamp before that frame. The truth's file also gets the case, which holds seeds and path, the `notes` on an
    import, the versions of `provenance`, per-pixel ground truth, and `true_rig`, where the pictures are of another rig
    than the nominal one of `rig`. Pictures are PNG, or JPEG of a quality from 1 to 100, and of one `colour`: mono8,
    rgb8 or bayer_rggb8.
    Raises SequenceError where stamps decrease, or a message does not fit the rig.
    """

    def __init__(
        self,
        folder: Path,
        rig: Rig,
        *,
        case_json: bytes | None,
        true_rig: Rig | None = None,
        jpeg_quality: int | None = None,
        colour: str = MONO,
        truth_channels: Sequence[str] = (),
        truth_names: TruthNames | None = None,
        start_ns: int = 0,
        notes: Mapping[str, str] | None = None,
        provenance: Mapping[str, str] | None = None,
    ) -> None:
        self._rig = rig
        self._true_rig = true_rig or rig
        self._channels = check_channels(truth_channels)
        self._jpeg_quality = jpeg_quality
        self._colour = colour
        self._info = [serialise(info) for info in camera_info_messages(0, rig)]
        self._form = ""
        self._blank = [b""]  # messages of pictures without a picture, by camera
        folder.mkdir(parents=True, exist_ok=True)
        pixel_topics = pixel_truth_topics(self._channels, self._true_rig.sides)
        topics = (*truth_topics(self._true_rig), *pixel_topics)
        sensors = BagWriter(folder / SENSORS_FILE, sensor_topics(rig), encoded=True)
        with ExitStack() as stack:
            # Contexts end in reverse order: where there is a file of the sensors, the truth is whole.
            self._sensors = stack.enter_context(sensors)
            truth = BagWriter(folder / TRUTH_FILE, topics, encoded=False)
            self._truth = stack.enter_context(truth)
            if case_json is not None:
                self._truth.attach(CASE_ATTACHMENT, "application/json", case_json)
            if self._channels:
                names = names_to_json(truth_names or TruthNames())
                self._truth.attach(NAMES_ATTACHMENT, "application/json", names)
            if provenance:
                self._truth.note(PROVENANCE_NOTE, provenance)
            if notes:
                self._truth.note(IMPORT_NOTE, notes)
            self._write_rigs(start_ns)
            self._stack = stack.pop_all()

    def _write_rigs(self, start_ns: int) -> None:
        write_mounts(self._sensors, self._rig, start_ns)
        write_mounts(self._truth, self._true_rig, start_ns)
        infos = camera_info_messages(start_ns, self._true_rig)
        for topic, info in zip(TRUE_INFO_TOPICS, infos, strict=False):
            self._truth.write(topic, start_ns, serialise(info))
        for bag in (self._sensors, self._truth):
            bag.flush()

    def write_frame(
        self,
        t_ns: int,
        left: Image,
        right: Image | None,
    ) -> None:
        """Add the picture of each camera, (H, W) or (H, W, 3) uint8, with its calibration."""
        form = "png" if self._jpeg_quality is None else "jpeg"
        encoded = []
        pictures = self._present(left, right)
        for side, name, picture in zip(self._rig.sides, NAMES, pictures, strict=False):
            camera = self._rig.camera(side)
            encoded.append(encode(picture, camera, name, jpeg_quality=self._jpeg_quality, colour=self._colour))
        self._write_pictures(t_ns, encoded, form)

    def write_encoded_frame(
        self,
        t_ns: int,
        left: bytes,
        right: bytes | None,
        form: str,
    ) -> None:
        """Add pictures that are 8-bit PNG or JPEG already, bit for bit; `form` is png or jpeg."""
        encoded = self._present(left, right)
        for side, name, picture in zip(self._rig.sides, NAMES, encoded, strict=False):
            camera = self._rig.camera(side)
            actual, _, _ = require_picture(picture, camera, name, colour=self._colour)
            if actual != form:
                raise SequenceError(f"{name} should be {form} but is {actual}")
        self._write_pictures(t_ns, encoded, form)

    def _present(self, left: T, right: T | None) -> list[T]:
        """The pictures that are not None. Raises SequenceError unless they are as many as the cameras."""
        pictures = [picture for picture in (left, right) if picture is not None]
        cameras = len(self._rig.sides)
        if len(pictures) != cameras:
            raise SequenceError(f"this rig has {cameras} cameras, but a frame has {len(pictures)} images")
        return pictures

    def _write_pictures(
        self,
        t_ns: int,
        encoded: Sequence[bytes],
        form: str,
    ) -> None:
        stop.check()
        t_ns = int(t_ns)
        if form != self._form:
            self._form = form
            blanks = [image_message(0, name, b"", codec=form, colour=self._colour) for name in NAMES]
            self._blank = [serialise(blank) for blank in blanks]
        for topic, info in zip(INFO_TOPICS, self._info, strict=False):
            self._sensors.write(topic, t_ns, with_stamp(info, t_ns))
        for topic, blank, picture in zip(IMAGE_TOPICS, self._blank, encoded, strict=False):
            self._sensors.write(topic, t_ns, with_picture(blank, t_ns, picture))

    def write_exposure(self, t_ns: int, time_s: float, gain_db: float) -> None:
        """Add the exposure time and the gain of the pictures of a stamp."""
        message = stamped_message(EXPOSURE, t_ns, LEFT, time_s=float(time_s), gain_db=float(gain_db))
        self._sensors.write(EXPOSURE, int(t_ns), serialise(message))

    def write_encoders(self, t_ns: ArrayLike, ticks: ArrayLike) -> None:
        """Add encoder readings: stamps (M,) and counts (M, 2) int64, left and right."""
        stamps = np.asarray(t_ns, np.int64).tolist()
        counts = np.asarray(ticks, np.int64).reshape(-1, 2).tolist()
        for t, (left, right) in zip(stamps, counts, strict=True):
            message = stamped_message(ENCODERS, t, BODY, left=left, right=right)
            self._sensors.write(ENCODERS, t, serialise(message))

    def write_imu(self, readings: ImuReadings) -> None:
        """Add readings of the IMU. Raises SequenceError where the rig has none."""
        gyro_variance = 0.0
        accel_variance = 0.0
        if imu := self._rig.imu:
            # The variance of white noise of a density that is sampled at a rate.
            gyro_variance = imu.gyro_noise**2 * imu.rate_hz
            accel_variance = imu.accel_noise**2 * imu.rate_hz
        rows = zip(readings.t_ns.tolist(), readings.gyro_radps, readings.accel_mps2, strict=True)
        for t, gyro_radps, accel_mps2 in rows:
            message = imu_message(t, gyro_radps, accel_mps2, gyro_variance=gyro_variance, accel_variance=accel_variance)
            self._sensors.write(IMU, t, serialise(message))

    def write_imu_bias(self, t_ns: int, gyro_radps: ArrayLike, accel_mps2: ArrayLike) -> None:
        """Add the biases in the IMU's readings, (3,) each, which vary slowly."""
        message = stamped_message(
            IMU_BIAS,
            t_ns,
            IMU_FRAME,
            gyro=vector_message(gyro_radps),
            accel=vector_message(accel_mps2),
        )
        self._truth.write(IMU_BIAS, int(t_ns), serialise(message))

    def write_disturbance(self, t_ns: int, slip: ArrayLike, push: ArrayLike) -> None:
        """Add the disturbances of the robot's motion.

        `slip` (3,) is that of the left and the right wheel, and the side slip in rad; `push` (2,) is on the speed in
        m/s² and on the yaw rate in rad/s².
        """
        left_slip, right_slip, side_slip_rad = np.asarray(slip, float).tolist()
        push_mps2, turn_push_radps2 = np.asarray(push, float).tolist()
        message = stamped_message(
            DISTURBANCE,
            t_ns,
            BODY,
            left_slip=left_slip,
            right_slip=right_slip,
            side_slip_rad=side_slip_rad,
            push_mps2=push_mps2,
            turn_push_radps2=turn_push_radps2,
        )
        self._truth.write(DISTURBANCE, int(t_ns), serialise(message))

    def write_truth(
        self,
        t_ns: int,
        T_world_body: Array,
        twist_body: ArrayLike | None,
    ) -> None:
        """Add the body's true pose (4, 4) and its twist (6,), m/s then rad/s, in body axes; None where unknown."""
        is_rigid = se3.is_rotation(T_world_body[:3, :3]) and np.isfinite(T_world_body).all()
        if not is_rigid:
            raise SequenceError(f"the true pose at {t_ns} ns is no rigid transform: {T_world_body.tolist()}")
        t_ns = int(t_ns)
        transform = tf_message(t_ns, WORLD, {BODY: T_world_body})
        odometry = odometry_message(t_ns, T_world_body, twist_body)
        self._truth.write(TF, t_ns, serialise(transform))
        self._truth.write(ODOMETRY, t_ns, serialise(odometry))

    def write_truth_frame(self, t_ns: int, side: Side, frame: TruthFrame) -> None:
        """Add the per-pixel ground truth of one camera's picture: the channels that the writer was opened for."""
        check_truth(frame, self._channels, self._true_rig.camera(side), side)
        for channel, values in frame.channels().items():
            message = truth_image(t_ns, side, channel, values)
            self._truth.write(truth_topic(side, channel), int(t_ns), serialise(message))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.__exit__(kind, error, trace)
