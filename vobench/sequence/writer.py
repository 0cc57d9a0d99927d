"""Writing a sequence: a folder with what an estimator may see, and apart from it the truth."""

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
from vobench.sequence import messages as ros
from vobench.sequence.bag import BagWriter
from vobench.sequence.calibration import write_mounts
from vobench.sequence.messages import pictured, serialise, stamped
from vobench.sequence.picture import MONO, Image, encode, require_picture
from vobench.sequence.pixel_truth import check_truth, names_to_json, truth_image, truth_topic, truth_topics

NAMES = (ros.LEFT, ros.RIGHT)

T = TypeVar("T")


class SequenceWriter:
    """Streams a recording into `folder`; both files appear when the context ends without an error.

    Stamps are `t_ns`, int64, from `start_ns`, which what never changes is stamped with. Calls come in order of
    time: readings up to a frame's stamp before that frame. The case goes with the truth, for it holds seeds and
    path, and so do `notes` on an import, the versions of `provenance`, what is true of pixels and `true_rig`,
    where it is not the `rig` that estimators are told. Pictures are PNG, or JPEG of a quality from 1 to 100, and of
    one `colour`: mono8, rgb8 or bayer_rggb8.
    Raises SequenceError where stamps fall, or what is written is not what the rig says.
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
        self._info = [serialise(info) for info in ros.camera_infos(0, rig)]
        self._form = ""
        self._blank = [b""]
        folder.mkdir(parents=True, exist_ok=True)
        sensed = ros.sensor_topics(rig)
        topics = (*ros.truth_topics(self._true_rig), *truth_topics(self._channels, self._true_rig.sides))
        with ExitStack() as stack:
            # What is entered first ends last: where there are sensors, the truth is whole.
            self._sensors = stack.enter_context(BagWriter(folder / ros.SENSORS_FILE, sensed, encoded=True))
            self._truth = stack.enter_context(BagWriter(folder / ros.TRUTH_FILE, topics, encoded=False))
            if case_json is not None:
                self._truth.attach(ros.CASE_ATTACHMENT, "application/json", case_json)
            if self._channels:
                names = names_to_json(truth_names or TruthNames())
                self._truth.attach(ros.NAMES_ATTACHMENT, "application/json", names)
            for name, entries in ((ros.PROVENANCE_NOTE, provenance), (ros.IMPORT_NOTE, notes)):
                if entries:
                    self._truth.note(name, entries)
            self._write_rigs(start_ns)
            self._stack = stack.pop_all()

    def _write_rigs(self, start_ns: int) -> None:
        write_mounts(self._sensors, self._rig, start_ns)
        write_mounts(self._truth, self._true_rig, start_ns)
        for topic, info in zip(ros.TRUE_INFO_TOPICS, ros.camera_infos(start_ns, self._true_rig), strict=False):
            self._truth.write(topic, start_ns, serialise(info))
        for bag in (self._sensors, self._truth):
            bag.flush()

    def write_frame(self, t_ns: int, left: Image, right: Image | None) -> None:
        """Add the picture of each camera, (H, W) or (H, W, 3) uint8, with its calibration."""
        form = "png" if self._jpeg_quality is None else "jpeg"
        cameras = [self._rig.camera(side) for side in self._rig.sides]
        encoded = [
            encode(picture, camera, name, jpeg_quality=self._jpeg_quality, colour=self._colour)
            for picture, camera, name in zip(self._present(left, right), cameras, NAMES, strict=False)
        ]
        self._write_pictures(t_ns, encoded, form)

    def write_encoded_frame(self, t_ns: int, left: bytes, right: bytes | None, form: str) -> None:
        """Add pictures that are 8-bit PNG or JPEG already, bit for bit; `form` is png or jpeg."""
        encoded = self._present(left, right)
        for side, name, picture in zip(self._rig.sides, NAMES, encoded, strict=False):
            found = require_picture(picture, self._rig.camera(side), name, colour=self._colour)[0]
            if found != form:
                raise SequenceError(f"{name} should be {form} but is {found}")
        self._write_pictures(t_ns, encoded, form)

    def _present(self, left: T, right: T | None) -> list[T]:
        """The pictures there are. Raises SequenceError unless they are as many as the cameras."""
        there = [picture for picture in (left, right) if picture is not None]
        if len(there) != len(self._rig.sides):
            raise SequenceError(f"this rig has {len(self._rig.sides)} cameras, but a frame has {len(there)} pictures")
        return there

    def _write_pictures(self, t_ns: int, encoded: Sequence[bytes], form: str) -> None:
        stop.check()
        t_ns = int(t_ns)
        if form != self._form:
            self._form = form
            self._blank = [serialise(ros.image(0, name, b"", form, self._colour)) for name in NAMES]
        for topic, info in zip(ros.INFO_TOPICS, self._info, strict=False):
            self._sensors.write(topic, t_ns, stamped(info, t_ns))
        for topic, blank, picture in zip(ros.IMAGE_TOPICS, self._blank, encoded, strict=False):
            self._sensors.write(topic, t_ns, pictured(blank, t_ns, picture))

    def write_exposure(self, t_ns: int, time_s: float, gain_db: float) -> None:
        """Add how the pictures of that stamp were exposed."""
        fields = float(time_s), float(gain_db)
        self._sensors.write(ros.EXPOSURE, int(t_ns), serialise(ros.message(ros.EXPOSURE, t_ns, ros.LEFT, *fields)))

    def write_encoders(self, t_ns: ArrayLike, ticks: ArrayLike) -> None:
        """Add encoder readings: stamps (M,) and counts (M, 2) int64, left and right."""
        stamps = np.asarray(t_ns, np.int64)
        counts = np.asarray(ticks, np.int64)
        for t, pair in zip(stamps.tolist(), counts.reshape(-1, 2).tolist(), strict=True):
            self._sensors.write(ros.ENCODERS, t, serialise(ros.message(ros.ENCODERS, t, ros.BODY, *pair)))

    def write_imu(self, readings: ImuReadings) -> None:
        """Add readings of the IMU. Raises SequenceError where the rig has none."""
        variances = (0.0, 0.0)
        if imu := self._rig.imu:  # white noise of a density, read at a rate
            variances = (imu.gyro_noise**2 * imu.rate_hz, imu.accel_noise**2 * imu.rate_hz)
        rows = zip(readings.t_ns.tolist(), readings.gyro_radps, readings.accel_mps2, strict=True)
        for t, gyro, accel in rows:
            self._sensors.write(ros.IMU, t, serialise(ros.imu(t, gyro, accel, variances)))

    def write_imu_bias(self, t_ns: int, gyro_radps: ArrayLike, accel_mps2: ArrayLike) -> None:
        """Add what the IMU's readings are off by, (3,) each, slowly varying."""
        bias = ros.vector(gyro_radps), ros.vector(accel_mps2)
        self._truth.write(ros.IMU_BIAS, int(t_ns), serialise(ros.message(ros.IMU_BIAS, t_ns, ros.IMU_FRAME, *bias)))

    def write_disturbance(self, t_ns: int, slip: ArrayLike, push: ArrayLike) -> None:
        """Add what disturbs the robot: slip of the left and right wheel and side slip in rad (3,), pushes (2,)."""
        fields = *np.asarray(slip, float).tolist(), *np.asarray(push, float).tolist()
        self._truth.write(ros.DISTURBANCE, int(t_ns), serialise(ros.message(ros.DISTURBANCE, t_ns, ros.BODY, *fields)))

    def write_truth(self, t_ns: int, T_world_body: Array, twist_body: ArrayLike | None) -> None:
        """Add the body's true pose (4, 4) and its twist (6,), m/s then rad/s, in body axes; None where unknown."""
        if not (se3.is_rotation(T_world_body[:3, :3]) and np.isfinite(T_world_body).all()):
            raise SequenceError(f"the true pose at {t_ns} ns is no rigid transform: {T_world_body.tolist()}")
        t_ns = int(t_ns)
        self._truth.write(ros.TF, t_ns, serialise(ros.transforms(t_ns, ros.WORLD, {ros.BODY: T_world_body})))
        self._truth.write(ros.ODOMETRY, t_ns, serialise(ros.odometry(t_ns, T_world_body, twist_body)))

    def write_truth_frame(self, t_ns: int, side: Side, frame: TruthFrame) -> None:
        """Add what is true of every pixel of one camera's picture: the channels that the writer was opened for."""
        check_truth(frame, self._channels, self._true_rig.camera(side), side)
        for channel, values in frame.channels().items():
            message = truth_image(t_ns, side, channel, values)
            self._truth.write(truth_topic(side, channel), int(t_ns), serialise(message))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)
