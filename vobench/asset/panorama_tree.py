"""Distant trees of panoramas: a few looks, resampled to any size and lit by sun and sky."""

from collections.abc import Sequence

import numpy as np

from vobench.asset.panorama_canvas import COLUMNS, PanoramaCanvas, azimuths, reflected_cd_m2
from vobench.asset.panorama_noise import Floats
from vobench.asset.picture import Rng, noise

TREE_PX = 128
TREE_KINDS = 6
BALLS = 70  # of leaves, in a crown
LEAST_LEVEL_PX = 4  # of a level's side
LEAST_ROWS = 3  # of a tree that is painted
WIDTH = 0.42  # half of a tree's picture, by its height
TRUNK_NORMAL = (0, -0.6, 0.3)

TreeLook = list[Floats]  # what a tree looks like (N, N, 5), at levels of half the size each, all with a rim of zeros
# channels of a tree's look
OPACITY = 0
NORMAL = slice(1, 4)  # to the right, up and towards the viewer
SHADE = 4


class _Crown:
    """The pictures (N, N) of a tree while its balls of leaves are added: opacity, nearest surface, and normals."""

    def __init__(self, rng: Rng) -> None:
        self._rng = rng
        shares = (np.arange(TREE_PX, dtype=np.float32) + 0.5) / TREE_PX
        self.x, self.y = np.meshgrid(2 * shares - 1, 1 - shares)  # -1 to 1 from left to right, 0 to 1 upwards
        self._half_width = rng.uniform(0.55, 0.95)
        self._raggedness = 0.06 * noise(rng, TREE_PX, 8, 64, slope=0.3)
        self.nearest = np.full((TREE_PX, TREE_PX), -9.0, np.float32)
        self.normals = np.zeros((TREE_PX, TREE_PX, 3), np.float32)
        self.opacity = np.zeros((TREE_PX, TREE_PX), np.float32)

    def add_trunk(self) -> Floats:
        """Add the trunk, which widens downwards. Returns where it is."""
        half_width = 0.03 + 0.05 * (0.3 - self.y)
        is_trunk = (np.abs(self.x) < half_width) & (self.y < 0.45)
        self.opacity[is_trunk] = 1
        self.normals[is_trunk] = TRUNK_NORMAL
        return is_trunk

    def add_ball(self) -> None:
        """Add a ball of leaves anywhere in the crown."""
        rng = self._rng
        azimuth = rng.uniform(0, 2 * np.pi)
        eccentricity = np.sqrt(rng.random())
        middle_x = self._half_width * eccentricity * np.cos(azimuth) * 0.8
        middle_y = 0.55 + 0.33 * eccentricity * np.sin(azimuth)
        depth = rng.uniform(-0.3, 0.3) * np.sqrt(max(1 - eccentricity**2, 0))
        radius = rng.uniform(0.06, 0.17)

        right = (self.x - middle_x) / radius
        up = (self.y - middle_y) * 1.6 / radius
        squared = right**2 + up**2 + 6 * self._raggedness
        surface = depth + radius * np.sqrt(np.maximum(1 - squared, 0))
        is_front = (squared < 1) & (surface > self.nearest)
        ahead = np.sqrt(np.maximum(1 - squared, 0.05))
        self.nearest[is_front] = surface[is_front]
        self.normals[is_front] = np.stack([right, up, ahead], -1)[is_front]
        self.opacity[is_front] = 1


def _tree_look(rng: Rng) -> TreeLook:
    """A crown of balls of leaves above a trunk, row 0 at the top."""
    crown = _Crown(rng)
    is_trunk = crown.add_trunk()
    for _ in range(BALLS):
        crown.add_ball()

    length = np.linalg.norm(crown.normals, axis=-1, keepdims=True)
    normals = crown.normals / np.maximum(length, 1e-6)

    # Leaves farther inside the crown are darker.
    leaves = noise(rng, TREE_PX, 10, 64, slope=0.3)
    depth = np.clip((crown.nearest + 0.3) / 0.6, 0, 1)
    shade = (0.45 + 0.55 * depth) * np.exp(0.25 * leaves)
    is_bare_trunk = is_trunk & (crown.nearest < -8)
    shade[is_bare_trunk] = 1.0

    look = np.concatenate([crown.opacity[..., None], normals, shade[..., None]], -1)
    return _levels(look.astype(np.float32))


class DistantTrees:
    """Trees of a few looks, seen at any size and place."""

    def __init__(self, canvas: PanoramaCanvas) -> None:
        self._canvas = canvas
        self._looks = [_tree_look(canvas.rng) for _ in range(TREE_KINDS)]

    def paint(self, azimuth: float, distance_m: float, height_m: float, *, sunk: float = 0.0) -> None:
        """A tree on the ground, or a bush: a tree of which a share of the height is sunk below it."""
        canvas = self._canvas
        look = self._looks[int(canvas.rng.integers(TREE_KINDS))]
        albedo = _leaf_albedo(canvas.rng)

        # Tangents and angles under which the tree is seen.
        height = height_m / distance_m
        half_width = WIDTH * height_m / distance_m
        ground = -canvas.eye_m / distance_m
        foot = ground - sunk * height_m / distance_m
        rows = canvas.rows(foot, foot + height)
        columns = canvas.columns(azimuth - half_width, azimuth + half_width)
        if rows.stop - rows.start < LEAST_ROWS or len(columns) > COLUMNS // 4:
            return

        row_share = 1 - (canvas.tangent[rows] - foot) * distance_m / height_m  # 0 at the top
        angle = azimuths(columns) - azimuth
        column_share = 0.5 - angle / (2 * half_width)  # azimuth grows to the left
        pixels = _resampled(look, row_share, column_share, max(len(columns), 1))

        is_above_ground = (canvas.tangent[rows, None] > ground) | (sunk == 0)
        opacity = pixels[..., OPACITY] * is_above_ground
        illuminance_lx = self._illuminance_lx(azimuth, pixels[..., NORMAL])
        colour = reflected_cd_m2(albedo, illuminance_lx * pixels[..., SHADE, None])
        canvas.paint(rows, columns, colour, opacity, distance_m=distance_m)

    def _illuminance_lx(self, azimuth: float, normals: Floats) -> Floats:
        """The illuminance (r, c, 3) by sun and sky of a tree's pixels with normals (r, c, 3), as in its look."""
        daylight = self._canvas.daylight
        sun = daylight.sun_direction
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        toward_viewer = np.array([-np.cos(azimuth), -np.sin(azimuth), 0.0])
        sun_in_look = np.array([right @ sun, sun[2], toward_viewer @ sun], np.float32)
        direct_lx = np.maximum(normals @ sun_in_look, 0)[..., None] * daylight.sun_lx
        sky_share = 0.55 + 0.45 * normals[..., 1]
        diffuse_lx = sky_share[..., None] * daylight.sky_lx
        return np.asarray(direct_lx + diffuse_lx)


def _leaf_albedo(rng: Rng) -> tuple[float, float, float]:
    """The albedo of leaves, between a dark and a bright green."""
    brightness = rng.uniform(0, 1)
    red = 0.045 + 0.05 * brightness
    green = 0.075 + 0.035 * brightness
    blue = 0.025 + 0.012 * brightness
    return red, green, blue


def _levels(values: Floats) -> list[Floats]:
    """Values (N, N, C), then the means of squares of 2 x 2 of them and so on, all with a rim of zeros."""
    levels = [values]
    while len(levels[-1]) >= 2 * LEAST_LEVEL_PX:
        finest = levels[-1]
        rows = (finest[::2] + finest[1::2]) / 2
        levels.append((rows[:, ::2] + rows[:, 1::2]) / 2)
    return [np.pad(level, [(1, 1), (1, 1), (0, 0)]) for level in levels]


def _resampled(levels: Sequence[Floats], row_share: Floats, column_share: Floats, size_px: int) -> Floats:
    """Values (r, c, C) at shares (r,), (c,) of the sides, from a level of about size_px pixels; 0 outside."""
    largest_px = 2 * max(size_px, LEAST_LEVEL_PX)
    padded = next(level for level in levels if len(level) - 2 < largest_px)
    size = len(padded) - 2
    y = np.clip(row_share * size + 0.5, 0, size + 0.999)
    x = np.clip(column_share * size + 0.5, 0, size + 0.999)
    top = y.astype(np.int32)
    left = x.astype(np.int32)
    lower_share = (y - top).astype(np.float32)[:, None, None]
    right_share = (x - left).astype(np.float32)[None, :, None]

    left_share = 1 - right_share
    upper = padded[top][:, left] * left_share + padded[top][:, left + 1] * right_share
    lower = padded[top + 1][:, left] * left_share + padded[top + 1][:, left + 1] * right_share
    return np.asarray(upper * (1 - lower_share) + lower * lower_share, np.float32)
