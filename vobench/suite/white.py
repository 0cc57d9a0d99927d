"""The white that cameras are exposed for, from what they see in a scene's light, and doubts about a stated white."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Mask
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.geometry import RayCaster
from vobench.rendering.seen_light import SeenLight, read_seen_light, seen_light
from vobench.suite.scene_build import listed_lights
from vobench.suite.scene_spec import SceneFile
from vobench.suite.viewpoint import viewpoints

# A small picture from each viewpoint: 92 x 66 degrees.
LENS = Pinhole(32, 20, 15.5, 15.5, 15.5, 9.5)

# The exposure of a camera with white at grey value 200 and an sRGB response; see vobench.sensor.image_sensor.
SATURATED_DN = 255
SATURATED = 1.73  # luminance relative to white from which a pixel is saturated
BLACK_DN = 16
BLACK = 0.009  # luminance relative to white up to which a pixel is black

# What white aims at.
WHITE_PERCENTILE = 95.0  # of the luminance of surfaces; lamps and the sky may be brighter
MOST_SATURATED = 0.05  # share of the pixels
MOST_BLACK = 0.2
TOLERANCE = 0.02  # of the share beyond these, within which the nearest white is taken
STEPS_PER_STOP = 8
MOST_STOPS = 6  # from the percentile
DIGITS = 3  # of white
DARK_WHITE_CD_M2 = 1.0  # of a scene that is wholly black

DOUBTFUL = 0.2  # share of saturated or of black pixels from which an exposure is doubted
LITTLE_BETTER = 0.9  # of the excess that the best exposure leaves


def look_around(baked: BakedScene) -> SeenLight:
    """What small pictures from the viewpoints of a scene show."""
    views = viewpoints(baked.faces, RayCaster(baked.faces))
    pixel_count = LENS.width_px * LENS.height_px
    eyes_m = np.array([view.eye_m for view in views])
    origins_m = np.repeat(eyes_m, pixel_count, axis=0)
    directions = np.concatenate([view.rays(LENS) for view in views])
    return seen_light(baked, origins_m, directions)


def white_of(spec: SceneFile, light: Path | None) -> float:
    """The luminance of white in cd/m²: what the scene's file states, or what follows from its light in a folder.

    It does not depend on lightings, which would otherwise be exposed away. Raises ValueError if neither is there, and
    RenderError if the light is damaged.
    """
    if spec.white_cd_m2 is not None:
        return spec.white_cd_m2
    if light is None:
        raise ValueError("a scene without white_cd_m2 needs its light")
    seen = read_seen_light(light)
    return fitting_white_cd_m2(seen.luminance(listed_lights(spec)), seen.is_source)


@dataclass(frozen=True, slots=True)
class ExposedShares:
    """The shares of pixels that are saturated and black."""

    saturated: float
    black: float

    @property
    def excess(self) -> float:
        """The share beyond what white aims at."""
        return max(self.saturated - MOST_SATURATED, 0.0) + max(self.black - MOST_BLACK, 0.0)

    def __str__(self) -> str:
        return f"{self.saturated:.0%} of the pixels are saturated and {self.black:.0%} black"

    @property
    def is_doubtful(self) -> bool:
        """Whether so many pixels are saturated or black that a user should know."""
        return max(self.saturated, self.black) > DOUBTFUL


def exposed_shares(luminance_cd_m2: Array, white_cd_m2: float) -> ExposedShares:
    """The shares of saturated and black pixels among luminances (N,) for some white."""
    relative = luminance_cd_m2 / white_cd_m2
    saturated = float((relative >= SATURATED).mean())
    black = float((relative <= BLACK).mean())
    return ExposedShares(saturated, black)


def fitting_white_cd_m2(luminance_cd_m2: Array, is_source: Mask) -> float:
    """The white for luminances (N,) in cd/m², some of which are of lamps and the sky, to three digits.

    It is a high percentile of the surfaces. Where that leaves too many pixels saturated or black, it is the nearest
    white whose excess is the least, to within TOLERANCE, and the brighter of two that are equally near.
    """
    is_lit = luminance_cd_m2 > 0
    is_lit_surface = is_lit & ~is_source
    if is_lit_surface.any():
        is_lit = is_lit_surface
    if not is_lit.any():
        return DARK_WHITE_CD_M2
    first_cd_m2 = np.percentile(luminance_cd_m2[is_lit], WHITE_PERCENTILE)

    steps = np.arange(MOST_STOPS * STEPS_PER_STOP + 1)
    nearest_first = np.stack([steps, -steps], axis=1).ravel()
    candidates_cd_m2 = first_cd_m2 * 2.0 ** (nearest_first / STEPS_PER_STOP)
    excess = [exposed_shares(luminance_cd_m2, white).excess for white in candidates_cd_m2.tolist()]
    best = int(np.argmax(np.array(excess) <= min(excess) + TOLERANCE))  # the first of them
    return float(f"{candidates_cd_m2[best]:.{DIGITS}g}")


@dataclass(frozen=True, slots=True)
class Remedy:
    """How a camera is exposed, and whether white_cd_m2 of the scene or exposure_gain of the camera is to be changed.

    `amplification` is that of the camera's gain in decibels.
    """

    white_cd_m2: float
    exposure_gain: float = 1.0
    amplification: float = 1.0
    changes_white: bool = True

    @property
    def effective_white_cd_m2(self) -> float:
        """The luminance that comes to grey value 200."""
        return self.white_cd_m2 / (self.exposure_gain * self.amplification)

    def sentence(self, factor: float) -> str:
        """What to change so that the effective white becomes `factor` times as bright."""
        if self.changes_white:
            verb = "raise" if factor > 1 else "lower"
            changed_cd_m2 = self.white_cd_m2 * factor
            return f"{verb} white_cd_m2 of the scene from {self.white_cd_m2:.3g} to about {changed_cd_m2:.2g}"
        verb = "lower" if factor > 1 else "raise"
        changed_gain = self.exposure_gain / factor
        gains = f"from {self.exposure_gain:.3g} to about {changed_gain:.2g}"
        return f"{verb} exposure_gain of the camera {gains}, or use auto_exposure"


def doubt_sentence(shares: ExposedShares, luminance_cd_m2: Array, is_source: Mask, remedy: Remedy) -> str:
    """What is wrong with pictures that have such shares, and what to change.

    luminance_cd_m2 and is_source (N,) are what cameras on the free path see.
    """
    seen = exposed_shares(luminance_cd_m2, remedy.effective_white_cd_m2)
    fitting_cd_m2 = fitting_white_cd_m2(luminance_cd_m2, is_source)
    fitting = exposed_shares(luminance_cd_m2, fitting_cd_m2)
    factor = fitting_cd_m2 / remedy.effective_white_cd_m2
    if fitting.excess > LITTLE_BETTER * seen.excess:
        return f"{shares}; no exposure is much better, so light the dark parts of the scene"
    return f"{shares}; {remedy.sentence(factor)}"
