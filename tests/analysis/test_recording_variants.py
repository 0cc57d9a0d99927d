"""Variants of a twin have the changes that are not removed, and the noise of their seeds."""

import numpy as np
import pytest

from tests.analysis.pictures import HEIGHT_PX, WIDTH_PX, rig
from vobench.analysis.picture_change import BLUR, DROPPED, ExposureJumps, MissingFrames
from vobench.analysis.recording_variants import TwinImages, TwinVariant
from vobench.geometry import se3
from vobench.sequence.picture import decode
from vobench.trajectory.trajectory import Trajectory

COUNT = 6
EXPOSURE = "exposure jumps"


@pytest.fixture
def images() -> TwinImages:
    t_ns = (np.arange(COUNT) * 10**8).astype(np.int64)
    flat = np.full((HEIGHT_PX, WIDTH_PX), 100, np.uint8)
    stops = np.zeros((3, 2))
    stops[1] = 1.0
    return TwinImages(
        rig=rig(),
        t_ns=t_ns,
        shots=((flat, flat),) * COUNT,
        truth=Trajectory(t_ns, se3.transform(np.eye(3), np.zeros((COUNT, 3)))),
        frame=np.array([0, 0, 0, 1, 2, 2]),
        is_recorded=np.array([True, False, False, True, True, False]),
        changes=(ExposureJumps("", stops), MissingFrames("")),
        noise_dn=2.0,
    )


def test_a_variant_has_the_frames_that_the_recording_has_unless_gaps_are_removed(images: TwinImages) -> None:
    assert images.recording(TwinVariant(1)).t_ns.tolist() == [0, 3 * 10**8, 4 * 10**8]
    assert images.recording(TwinVariant(1, (DROPPED,))).frame_count == COUNT


def test_a_frame_has_the_changes_of_the_nearest_recorded_frame(images: TwinImages) -> None:
    means = [frame.left.mean() for frame in images.recording(TwinVariant(1, (DROPPED,))).frames()]
    assert means == pytest.approx([100, 100, 100, 200, 100, 100], abs=0.2)
    without = [frame.left.mean() for frame in images.recording(TwinVariant(1, (DROPPED, EXPOSURE))).frames()]
    assert without == pytest.approx([100] * COUNT, abs=0.2)


def test_noise_follows_from_the_seed_alone(images: TwinImages) -> None:
    def first_left(variant: TwinVariant) -> np.ndarray:
        return next(iter(images.recording(variant).frames())).left

    assert (first_left(TwinVariant(1)) == first_left(TwinVariant(1, (DROPPED, EXPOSURE, BLUR)))).all()
    assert (first_left(TwinVariant(1)) != first_left(TwinVariant(2))).any()
    assert first_left(TwinVariant(1)).std() == pytest.approx(2, rel=0.05)


def test_encoded_frames_are_the_same_pictures(images: TwinImages) -> None:
    recording = images.recording(TwinVariant(1))
    for frame, encoded in zip(recording.frames(), recording.encoded_frames(), strict=True):
        assert frame.t_ns == encoded.t_ns
        assert (decode(encoded.right, recording.rig.camera("right"), "right") == frame.right).all()
