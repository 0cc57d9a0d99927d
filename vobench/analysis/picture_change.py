"""Changes of the images in a part of a recording, and how each is put into the images of a simulation."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.analysis.cause_text import CAUSE_TEXTS, CauseText
from vobench.estimator.stereo import StereoPair
from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image

Grey = NDArray[np.float32]  # (H, W), grey values of an image before they are rounded

BLUR = "blurred images"
NOISE = "noisy images"
EXPOSURE = "exposure jumps"
DIRT = "dirt on the lens"
TURNED = "a turned camera"
DROPPED = "missing frames"

ORDER = (TURNED, DIRT, BLUR, EXPOSURE, NOISE)  # in which light and chip cause them

LEFT = 0  # the side of the left camera
LARGEST_DN = 255
OUTSIDE_PX = -1e4  # a coordinate outside of every image


@dataclass(frozen=True, slots=True)
class ImageSpot:
    """An image of a recording: its frame, its side (0 is left, 1 right), and random numbers for it."""

    frame: int
    side: int
    rng: np.random.Generator


class ImageChange(Protocol):
    """One property in which the images of F frames of a recording differ from the rest of it.

    `evidence` is a clause that states what was measured, and in how many frames.
    """

    @property
    def name(self) -> str:
        """The name of the property."""

    @property
    def evidence(self) -> str:
        """What was measured."""

    def applied(self, picture: Grey, spot: ImageSpot) -> Grey:
        """The image with the property that the image at a spot of the recording has."""


@dataclass(frozen=True, slots=True)
class Blur:
    """Gaussian blur with a standard deviation (F, 2) in px, by frame and side."""

    evidence: str
    sigma_px: Array
    name: str = BLUR

    def applied(self, picture: Grey, spot: ImageSpot) -> Grey:
        """The blurred image."""
        return blurred(picture, float(self.sigma_px[spot.frame, spot.side]))


def blurred(picture: Grey, sigma_px: float) -> Grey:
    """An image with Gaussian blur."""
    if sigma_px <= 0:
        return picture
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma_px), np.float32)


@dataclass(frozen=True, slots=True)
class Noise:
    """Additional noise with a standard deviation (F, 2) in grey values, by frame and side."""

    evidence: str
    sigma_dn: Array
    name: str = NOISE

    def applied(self, picture: Grey, spot: ImageSpot) -> Grey:
        """The noisier image."""
        return noisy(picture, float(self.sigma_dn[spot.frame, spot.side]), spot.rng)


def noisy(picture: Grey, sigma_dn: float, rng: np.random.Generator) -> Grey:
    """An image with normally distributed noise."""
    noise = rng.standard_normal(picture.shape, dtype=np.float32)
    return picture + np.float32(sigma_dn) * noise


@dataclass(frozen=True, slots=True)
class ExposureJumps:
    """Brightness that differs by stops (F, 2) from that of the frames before, by frame and side."""

    evidence: str
    stops: Array
    name: str = EXPOSURE

    def applied(self, picture: Grey, spot: ImageSpot) -> Grey:
        """The brighter or darker image."""
        gain = np.float32(2 ** self.stops[spot.frame, spot.side])
        exposed: Grey = np.clip(np.rint(gain * picture), 0, LARGEST_DN)
        return exposed


@dataclass(frozen=True, slots=True)
class Dirt:
    """Dirt that scales grey values by `transmission` (2, H, W) and adds `veil_dn` (2, H, W), by side.

    `is_dirty` (F, 2) states in which frames.
    """

    evidence: str
    is_dirty: NDArray[np.bool_]
    transmission: Array
    veil_dn: Array
    name: str = DIRT

    def applied(self, picture: Grey, spot: ImageSpot) -> Grey:
        """The image behind the dirt, in a dirty frame."""
        if not self.is_dirty[spot.frame, spot.side]:
            return picture
        return np.asarray(self.transmission[spot.side] * picture + self.veil_dn[spot.side], np.float32)


@dataclass(frozen=True, slots=True)
class TurnedCamera:
    """A right camera that is rotated by roll, pitch and yaw (F, 3) in degrees relative to the rest of the recording.

    The signs are those of `CalibrationError`.
    """

    evidence: str
    angles_deg: Array
    pair: StereoPair
    name: str = TURNED

    def applied(self, picture: Grey, spot: ImageSpot) -> Grey:
        """The image of the turned camera, if it is the right one."""
        angles_deg = self.angles_deg[spot.frame]
        if spot.side == LEFT or not angles_deg.any():
            return picture
        return turned(picture, angles_deg, self.pair)


def turned(picture: Grey, angles_deg: Array, pair: StereoPair) -> Grey:
    """The image of the right camera after a small rotation by roll, pitch and yaw (3,), in degrees.

    A point (x, y) of the view then appears lower by f (p (1 + y²) - r x - w x y) and further left by
    f (w (1 + x²) - r y - p x y), as in `stereo_fit`.
    """
    roll, pitch, yaw = np.deg2rad(angles_deg)
    height_px, width_px = picture.shape
    columns, rows = np.meshgrid(np.arange(width_px), np.arange(height_px))
    pixels = np.stack([columns, rows], -1).reshape(-1, 2)
    rays = pair.right.rays(pixels)
    x = rays[:, 0]
    y = rays[:, 1]

    # Each pixel of the new image shows what the old image has at the place before the rotation.
    lower = pitch * (1 + y * y) - roll * x - yaw * x * y
    further_left = yaw * (1 + x * x) - roll * y - pitch * x * y
    before = np.stack([x + further_left, y - lower, np.ones_like(x)], -1)
    source_px = np.nan_to_num(pair.right.project(before), nan=OUTSIDE_PX).astype(np.float32)
    source_columns, source_rows = source_px.T.reshape(2, height_px, width_px)
    shown = cv2.remap(
        picture,
        np.ascontiguousarray(source_columns),
        np.ascontiguousarray(source_rows),
        cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(shown, np.float32)


@dataclass(frozen=True, slots=True)
class MissingFrames:
    """Frames that the recording lacks; no image of the others differs."""

    evidence: str
    name: str = DROPPED


PictureChange = ImageChange | MissingFrames


def changed_picture(
    picture: Image,
    changes: Sequence[PictureChange],
    spot: ImageSpot,
    *,
    noise_dn: float,
) -> Image:
    """An image without noise, after changes and with noise."""
    of_images = [change for change in changes if not isinstance(change, MissingFrames)]
    values = picture.astype(np.float32)
    for change in sorted(of_images, key=lambda change: ORDER.index(change.name)):
        values = change.applied(values, spot)
    values = noisy(values, noise_dn, spot.rng)
    return np.clip(np.rint(values), 0, LARGEST_DN).astype(np.uint8)


# What a twin has without a change.
INSTEAD = {
    BLUR: "sharp images",
    NOISE: "the usual noise",
    EXPOSURE: "a steady exposure",
    DIRT: "a clean lens",
    TURNED: "the cameras as in the rest of the recording",
    DROPPED: "all frames",
}
CHANGE_TEXTS = {
    BLUR: CauseText("the images are blurred", "focus the lens, expose shorter, or vibrate less"),
    NOISE: CAUSE_TEXTS["noise"],
    EXPOSURE: CauseText("the exposure jumps", CAUSE_TEXTS["auto-exposure"].advice),
    DIRT: CauseText("the lens is dirty", "clean the lens, or mask the dirt"),
    TURNED: CauseText("a camera has turned", "mount the cameras firmly, and calibrate them again"),
    DROPPED: CAUSE_TEXTS["dropped frames"],
}
