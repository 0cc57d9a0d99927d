"""ORB-SLAM3 behind vobench's stream: python client.py stereo | mono | inertial. See docs/estimators.md."""

import json
import os
import struct
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
FRAME = struct.Struct("<qqIIIIII")
OK = 1
LOST = 4
# off a steady motion from frame to frame: no hand does that
JUMP_M = 0.15
JUMP_DEG = 8.0
# What the library prints must not fall among the answers.
ANSWERS = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)

import pyorbslam3  # noqa: E402


def read(length: int) -> bytes:
    """So many bytes of standard input."""
    data = sys.stdin.buffer.read(length)
    if len(data) < length:
        os._exit(2)
    return data


def send(tag: bytes, payload: bytes = b"") -> None:
    """One message."""
    ANSWERS.write(struct.pack("<4sI", tag, len(payload)) + payload)
    ANSWERS.flush()


def matrix(name: str, T: np.ndarray) -> str:
    """A (4, 4) as OpenCV writes it in YAML."""
    data = ", ".join(f"{x:.9f}" for x in T.ravel())
    return f"{name}: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: [{data}]\n"


def settings(calibration: dict, rate_hz: float) -> str:
    """The settings file, in the form that ORB-SLAM2 and 3 share, of an ideal pinhole or pair."""
    left = calibration["cameras"][0]
    T_left = np.array(left["T_body_camera"])
    values = {"Camera.type": '"PinHole"'}
    values |= {f"Camera.{n}": float(left[f"{n}_px"]) for n in ("fx", "fy", "cx", "cy")}
    values |= {f"Camera.{n}": 0.0 for n in ("k1", "k2", "p1", "p2")}
    values |= {"Camera.width": left["width_px"], "Camera.height": left["height_px"]}
    values |= {"Camera.fps": max(round(rate_hz), 1), "Camera.RGB": 1, "ThDepth": 40.0}
    if len(calibration["cameras"]) > 1:
        apart_m = np.linalg.norm(np.array(calibration["cameras"][1]["T_body_camera"])[:3, 3] - T_left[:3, 3])
        values["Camera.bf"] = float(left["fx_px"] * apart_m)
    features = {"nFeatures": 1200, "scaleFactor": 1.2, "nLevels": 8, "iniThFAST": 20, "minThFAST": 7}
    values |= {f"ORBextractor.{name}": value for name, value in features.items()}
    sizes = ("KeyFrameSize", "KeyFrameLineWidth", "GraphLineWidth", "PointSize", "CameraSize", "CameraLineWidth")
    values |= {f"Viewer.{name}": 1.0 for name in (*sizes, "ViewpointX", "ViewpointY", "ViewpointZ", "ViewpointF")}
    text = "%YAML:1.0\n"
    imu = calibration["imu"]
    if imu:
        noises = {
            "NoiseGyro": "gyro_noise",
            "NoiseAcc": "accel_noise",
            "GyroWalk": "gyro_walk",
            "AccWalk": "accel_walk",
        }
        values |= {f"IMU.{name}": float(imu[key]) for name, key in noises.items()}
        values["IMU.Frequency"] = round(imu["rate_hz"])
        text += matrix("Tbc", np.linalg.inv(np.array(imu["T_body_imu"])) @ T_left)
    return text + "".join(f"{name}: {value}\n" for name, value in values.items())


class Tracker:
    """One system; poses are of the left camera in its first place, kept continuous where the map is aligned anew."""

    def __init__(self, mode: str, calibration: dict) -> None:
        self._mode = mode
        self._t0_ns = None
        file = Path(tempfile.mkdtemp()) / "settings.yaml"
        file.write_text(settings(calibration, calibration["rate_hz"]))
        sensor = {"stereo": "STEREO", "mono": "MONOCULAR", "inertial": "IMU_STEREO"}[mode]
        vocabulary = str(HERE / ".venv" / "vocabulary.txt")
        self._slam = pyorbslam3.Slam(vocabulary, str(file), getattr(pyorbslam3.Sensor, sensor), use_viewer=False)
        self._T_odom_map = None
        self._last = np.eye(4)
        self._step = np.eye(4)

    def pose(self, payload: bytes) -> np.ndarray | None:
        """T_odom_left after a frame, None where it is lost."""
        _, t_ns, width, height, channels, count, readings, _ = FRAME.unpack_from(payload)
        size = count * width * height * channels
        eyes = np.frombuffer(payload, np.uint8, size, FRAME.size).reshape(count, height, width)
        self._t0_ns = t_ns - 1_000_000_000 if self._t0_ns is None else self._t0_ns
        t_s = (t_ns - self._t0_ns) / 1e9
        if self._mode == "mono":
            result = self._slam.track_monocular(eyes[0], t_s)
        elif self._mode == "stereo":
            result = self._slam.track_stereo(eyes[0], eyes[1], t_s)
        else:
            kind = np.dtype([("t", "<i8"), ("v", "<f8", 6)])
            rows = np.frombuffer(payload, kind, readings, FRAME.size + size)
            imu = np.column_stack([(rows["t"] - self._t0_ns) / 1e9, rows["v"]])
            result = self._slam.track_stereo(eyes[0], eyes[1], t_s, imu=imu)
        if not result.pose_valid:
            self._step = np.eye(4)
            return None
        return self._continued(np.asarray(result.pose_wc, float))

    def _continued(self, T_map_left: np.ndarray) -> np.ndarray:
        """The pose in odom, which stays where the map is turned upright, at some time after the IMU is initialised."""
        expected = self._last @ self._step
        if self._T_odom_map is None or (self._mode == "inertial" and self._jumps(expected, T_map_left)):
            self._T_odom_map = expected @ np.linalg.inv(T_map_left)
        T = self._T_odom_map @ T_map_left
        u, _, v = np.linalg.svd(T[:3, :3])
        T[:3, :3] = u @ v
        self._step = np.linalg.inv(self._last) @ T
        self._last = T
        return T

    def _jumps(self, expected: np.ndarray, T_map_left: np.ndarray) -> bool:
        off = np.linalg.inv(expected) @ self._T_odom_map @ T_map_left
        turned = np.degrees(np.arccos(np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1)))
        return bool(np.linalg.norm(off[:3, 3]) > JUMP_M or turned > JUMP_DEG)


def main() -> None:
    """Answer until there are no more frames."""
    tracker = None
    while True:
        tag, length = struct.unpack("<4sI", read(8))
        payload = read(length)
        if tag == b"CALB":
            calibration = json.loads(payload)
            if calibration["cameras"][0]["model"] != "Pinhole":
                send(b"FAIL", b"this client takes ideal pinholes only")
                os._exit(0)
            tracker = Tracker(sys.argv[1], calibration)
            send(b"REDY")
        elif tag == b"FRAM":
            T = tracker.pose(payload)
            index = FRAME.unpack_from(payload)[0]
            body = b"" if T is None else T[:3].astype("<f8").tobytes()
            send(b"POSE", struct.pack("<qII", index, OK if body else LOST, int(bool(body))) + body)
        elif tag == b"DONE":
            send(b"DONE")
            os._exit(0)  # its threads do not always end


if __name__ == "__main__":
    main()
