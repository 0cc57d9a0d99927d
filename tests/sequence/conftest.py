"""A small recording that the sequence tests share."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig, WheelGeometry, stereo_rig
from vobench.geometry.se3 import Array
from vobench.sequence import SequenceWriter
from vobench.sequence.recording import topic_facts

CASE = b'{"seed": 7}'
RIG = stereo_rig(
    Pinhole(48, 32, 40.5, 41.25, 23.5, 15.5), pitch_deg=33.3, baseline_m=0.117, wheels=WheelGeometry(0.1, 0.3, 4096)
)


@dataclass(frozen=True, slots=True)
class Recording:
    """What goes into a sequence, as arrays."""

    rig: Rig
    t_ns: NDArray[np.int64]
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    encoder_t_ns: NDArray[np.int64]
    ticks: NDArray[np.int64]
    T_map_body: Array
    twist: Array
    slip: Array
    push: Array

    def write(self, folder: Path) -> Path:
        with SequenceWriter(folder, self.rig, case_json=CASE) as sequence:
            done = 0
            for i, t_ns in enumerate(self.t_ns.tolist()):
                until = int(np.searchsorted(self.encoder_t_ns, t_ns, side="right"))
                sequence.write_encoders(self.encoder_t_ns[done:until], self.ticks[done:until])
                sequence.write_frame(t_ns, self.left[i], self.right[i])
                sequence.write_exposure(t_ns, 0.001 * (i + 1), 6.0)
                sequence.write_truth(t_ns, self.T_map_body[i], self.twist[i])
                sequence.write_disturbance(t_ns, self.slip[i], self.push[i])
                done = until
        return folder


def make_recording(count: int = 9) -> Recording:
    rng = np.random.default_rng(3)
    t_ns = np.arange(count) * 1_000_000_000 // 30
    encoder_t_ns = np.arange(1, int(t_ns[-1]) // 10_000_000 + 1) * 10_000_000
    q_xyzw = rng.normal(size=(count, 4))
    R = se3.from_quaternion(q_xyzw / np.linalg.norm(q_xyzw, axis=1, keepdims=True))
    images = rng.integers(0, 256, (2, count, 32, 48), np.uint8)
    ticks = rng.integers(-(2**40), 2**40, (len(encoder_t_ns), 2))
    poses = se3.transform(R, rng.normal(size=(count, 3)))
    twist, slip, push = (rng.normal(size=(count, width)) for width in (6, 3, 2))
    return Recording(RIG, t_ns, images[0], images[1], encoder_t_ns, ticks, poses, twist, slip, push)


@pytest.fixture(name="make")
def make_fixture() -> Callable[[int], Recording]:
    return make_recording


@pytest.fixture(name="counts", scope="session")
def counts_fixture() -> Callable[[Path], dict[str, int]]:
    """How many messages each topic of a file has."""
    return lambda path: {facts.name: facts.count for facts in topic_facts(path)}


@pytest.fixture(scope="session")
def recording() -> Recording:
    return make_recording()


@pytest.fixture(scope="session")
def folder(recording: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recording.write(tmp_path_factory.mktemp("sequence"))
