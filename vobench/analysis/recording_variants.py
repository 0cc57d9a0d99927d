"""The twin of a part of a recording: simulated images into which the changes of the recording's images are put."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.explanation import Removal
from vobench.analysis.picture_change import DROPPED, ImageSpot, PictureChange, changed_picture
from vobench.dataset.recording import Recording
from vobench.geometry.rig import Rig
from vobench.sequence import EncodedFrame, StereoFrame
from vobench.sequence.picture import Image, encode
from vobench.trajectory.trajectory import Stamps, Trajectory


@dataclass(frozen=True, slots=True)
class TwinVariant:
    """A repeat of the twin without some of the changes."""

    seed: int
    removed: Removal = ()


@dataclass(frozen=True, slots=True)
class TwinImages:
    """K frames of the twin at regular times, without noise and without changes, and what the recording has there.

    `shots` are pairs of a left and a right image. `frame` (K,) is the frame of the recording's part that is nearest in
    time, and `is_recorded` (K,) states that the recording has a frame at that time. `noise_dn` is the noise of the rest
    of the recording.
    """

    rig: Rig
    t_ns: Stamps
    shots: tuple[tuple[Image, Image], ...]
    truth: Trajectory
    frame: NDArray[np.intp]
    is_recorded: NDArray[np.bool_]
    changes: tuple[PictureChange, ...]
    noise_dn: float

    def frames_of(self, variant: TwinVariant) -> NDArray[np.intp]:
        """The frames that a variant has: all, or those that the recording has."""
        has_gaps = any(change.name == DROPPED for change in self._kept(variant))
        return np.flatnonzero(self.is_recorded) if has_gaps else np.arange(len(self.t_ns))

    def recording(self, variant: TwinVariant) -> Recording:
        """A variant as a recording. Its noise follows from the seed."""
        return Recording(
            form="vobench",
            rig=self.rig,
            frames=partial(self._frames, variant),
            encoded_frames=partial(self._encoded_frames, variant),
            t_ns=self.t_ns[self.frames_of(variant)],
            start_ns=0,
            truth=self.truth,
        )

    def _kept(self, variant: TwinVariant) -> Sequence[PictureChange]:
        return [change for change in self.changes if change.name not in variant.removed]

    def _frames(self, variant: TwinVariant) -> Iterator[StereoFrame]:
        for index, k in enumerate(self.frames_of(variant).tolist()):
            left = self._image(variant, k, 0)
            right = self._image(variant, k, 1)
            yield StereoFrame(index, int(self.t_ns[k]), left, right)

    def _image(self, variant: TwinVariant, k: int, side: int) -> Image:
        """The image of frame `k` and a side; variants with the same seed have the same noise."""
        rng = np.random.default_rng([variant.seed, k, side])
        spot = ImageSpot(int(self.frame[k]), side, rng)
        return changed_picture(self.shots[k][side], self._kept(variant), spot, noise_dn=self.noise_dn)

    def _encoded_frames(self, variant: TwinVariant) -> Iterator[EncodedFrame]:
        for frame in self._frames(variant):
            assert frame.right is not None
            left = encode(frame.left, self.rig.camera("left"), "left")
            right = encode(frame.right, self.rig.camera("right"), "right")
            yield EncodedFrame(frame.index, frame.t_ns, "png", left, right)
