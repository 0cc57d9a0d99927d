"""Distant trees of panoramas: a few looks, resampled to any size and lit by sun and sky."""

import numpy as np

from vobench.asset.panorama_canvas import COLUMNS, PanoramaCanvas, azimuths, reflected_cd_m2
from vobench.asset.panorama_noise import Floats
from vobench.asset.picture import Rng, noise

TREE_KINDS = 6  # looks of a panorama
TREE_PX = 128  # side of the picture of a look
LEAST_LEVEL_PX = 4  # side of the smallest level of a mipmap
LEAST_ROWS = 3  # of a tree that is painted
MOST_COLUMNS = COLUMNS // 4  # likewise; a wider one would be very near
HALF_WIDTH = 0.42  # half the width of the picture of a tree, relative to its height

# A crown is made of balls of leaves. In the picture of a look, x is -1 to 1 from left to right, and y 0 to 1 upwards.
BALLS = 70
CROWN_HALF_WIDTH = (0.55, 0.95)
CROWN_MIDDLE_Y = 0.55
BALLS_HALF_WIDTH = 0.8  # of the middles of the balls, relative to the crown's
BALLS_HALF_HEIGHT = 0.33  # of the middles of the balls
BALL_RADIUS = (0.06, 0.17)
BALL_ASPECT = 1.6  # width of a ball over its height, in units of x and y
CROWN_DEPTH = 0.3  # of the middles of the balls, to either side of the middle of the crown
NO_LEAVES = -9.0  # depth where there are no leaves, far behind all balls

TRUNK_TOP_Y = 0.45
TRUNK_NORMAL = (0, -0.6, 0.3)

# Albedo of the darkest leaves, and what is added to it for the brightest ones.
DARK_LEAF = (0.045, 0.075, 0.025)
LEAF_RANGE = (0.05, 0.035, 0.012)

# The picture of a look (N, N, 5) has its first row at the top. Its channels:
OPACITY = 0
NORMAL = slice(1, 4)  # to the right, up and towards the viewer
SHADE = 4  # factor of the illuminance, smaller inside the crown

# Pictures of half the size each. They have a rim of zeros, so that a tree is not cut off at the edges.
Mipmap = list[Floats]


class _Crown:
    """The picture of a tree while its balls of leaves are added, as arrays (N, N)."""

    def __init__(self, rng: Rng) -> None:
        self._rng = rng
        shares = (np.arange(TREE_PX, dtype=np.float32) + 0.5) / TREE_PX
        self.x, self.y = np.meshgrid(2 * shares - 1, 1 - shares)
        self._half_width = rng.uniform(*CROWN_HALF_WIDTH)
        # Added to the squared distance from the middle of a ball, so that the edges of balls are ragged.
        self._raggedness = 6 * (0.06 * noise(rng, TREE_PX, 8, 64, slope=0.3))
        self.depth = np.full((TREE_PX, TREE_PX), NO_LEAVES, np.float32)  # of the front leaves; larger is nearer
        self.normals = np.zeros((TREE_PX, TREE_PX, 3), np.float32)
        self.opacity = np.zeros((TREE_PX, TREE_PX), np.float32)

    def add_trunk(self) -> Floats:
        """Add the trunk, which widens downwards. Returns the pixels where it is."""
        half_width = 0.03 + 0.05 * (0.3 - self.y)
        is_trunk = (np.abs(self.x) < half_width) & (self.y < TRUNK_TOP_Y)
        self.opacity[is_trunk] = 1
        self.normals[is_trunk] = TRUNK_NORMAL
        return is_trunk

    def add_ball(self) -> None:
        """Add a ball of leaves anywhere in the crown. It hides what is behind it."""
        rng = self._rng
        angle = rng.uniform(0, 2 * np.pi)
        eccentricity = np.sqrt(rng.random())
        middle_x = self._half_width * eccentricity * np.cos(angle) * BALLS_HALF_WIDTH
        middle_y = CROWN_MIDDLE_Y + BALLS_HALF_HEIGHT * eccentricity * np.sin(angle)
        # The crown is deepest at its middle, as an ellipsoid.
        middle_depth = rng.uniform(-CROWN_DEPTH, CROWN_DEPTH) * np.sqrt(max(1 - eccentricity**2, 0))
        radius = rng.uniform(*BALL_RADIUS)

        # The components of the normal of the unit ball at each pixel.
        right = (self.x - middle_x) / radius
        up = (self.y - middle_y) * BALL_ASPECT / radius
        squared_distance = right**2 + up**2 + self._raggedness
        towards_viewer = np.sqrt(np.maximum(1 - squared_distance, 0.05))  # not 0, so that normals are well defined

        surface = middle_depth + radius * np.sqrt(np.maximum(1 - squared_distance, 0))
        is_in_front = (squared_distance < 1) & (surface > self.depth)
        normals = np.stack([right, up, towards_viewer], -1)
        self.depth[is_in_front] = surface[is_in_front]
        self.normals[is_in_front] = normals[is_in_front]
        self.opacity[is_in_front] = 1


def _tree_look(rng: Rng) -> Mipmap:
    """The look of a tree: a crown of balls of leaves above a trunk."""
    crown = _Crown(rng)
    is_trunk = crown.add_trunk()
    for _ in range(BALLS):
        crown.add_ball()

    length = np.linalg.norm(crown.normals, axis=-1, keepdims=True)
    normals = crown.normals / np.maximum(length, 1e-6)

    # Leaves farther inside the crown are darker.
    leaves = noise(rng, TREE_PX, 10, 64, slope=0.3)
    nearness = np.clip((crown.depth + CROWN_DEPTH) / (2 * CROWN_DEPTH), 0, 1)
    shade = (0.45 + 0.55 * nearness) * np.exp(0.25 * leaves)
    is_bare_trunk = is_trunk & (crown.depth < NO_LEAVES + 1)
    shade[is_bare_trunk] = 1.0

    look = np.concatenate([crown.opacity[..., None], normals, shade[..., None]], -1)
    return _mipmap(look.astype(np.float32))


class DistantTrees:
    """Trees of a few looks, seen at any size and place."""

    def __init__(self, canvas: PanoramaCanvas) -> None:
        self._canvas = canvas
        self._looks = [_tree_look(canvas.rng) for _ in range(TREE_KINDS)]

    def paint(self, azimuth: float, distance_m: float, height_m: float, *, sunk: float = 0.0) -> None:
        """Paint a tree that stands on the ground, or a bush: a tree of which a share of the height is below the ground.

        Trees that would be very small or very near are left out.
        """
        canvas = self._canvas
        look = self._looks[int(canvas.rng.integers(TREE_KINDS))]
        albedo = _leaf_albedo(canvas.rng)

        # Heights are tangents of the elevation; the width is an angle in radians.
        height = height_m / distance_m
        half_width = HALF_WIDTH * height_m / distance_m
        ground = -canvas.eye_m / distance_m
        foot = ground - sunk * height_m / distance_m
        rows = canvas.rows(foot, foot + height)
        columns = canvas.columns(azimuth - half_width, azimuth + half_width)
        is_too_small = rows.stop - rows.start < LEAST_ROWS
        is_too_wide = len(columns) > MOST_COLUMNS
        if is_too_small or is_too_wide:
            return

        tangent = canvas.tangent[rows]
        row_share = 1 - (tangent - foot) * distance_m / height_m  # 0 at the top of the picture
        angle = azimuths(columns) - azimuth
        column_share = 0.5 - angle / (2 * half_width)  # 0 at the left side: the azimuth grows to the left
        pixels = _resampled(look, row_share, column_share, size_px=max(len(columns), 1))

        is_above_ground = (tangent[:, None] > ground) | (sunk == 0)
        opacity = pixels[..., OPACITY] * is_above_ground
        illuminance_lx = self._illuminance_lx(azimuth, pixels[..., NORMAL])
        colour = reflected_cd_m2(albedo, illuminance_lx * pixels[..., SHADE, None])
        canvas.paint(rows, columns, colour, opacity, distance_m=distance_m)

    def _illuminance_lx(self, azimuth: float, normals: Floats) -> Floats:
        """The illuminance (r, c, 3) by sun and sky of pixels of a tree at an azimuth, with normals (r, c, 3)."""
        daylight = self._canvas.daylight
        sun = daylight.sun_direction
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        towards_viewer = np.array([-np.cos(azimuth), -np.sin(azimuth), 0.0])
        sun_in_look = np.array([right @ sun, sun[2], towards_viewer @ sun], np.float32)
        cosine = np.maximum(normals @ sun_in_look, 0)
        direct_lx = cosine[..., None] * daylight.sun_lx
        sky_share = 0.55 + 0.45 * normals[..., 1]
        diffuse_lx = sky_share[..., None] * daylight.sky_lx
        return np.asarray(direct_lx + diffuse_lx)


def _leaf_albedo(rng: Rng) -> tuple[float, float, float]:
    """The albedo of leaves, between a dark and a bright green."""
    brightness = rng.uniform(0, 1)
    red, green, blue = (dark + extra * brightness for dark, extra in zip(DARK_LEAF, LEAF_RANGE, strict=True))
    return red, green, blue


def _mipmap(picture: Floats) -> Mipmap:
    """A picture (N, N, C) and the means of its squares of 2 x 2 pixels, of those of 4 x 4, and so on."""
    levels = [picture]
    while len(levels[-1]) >= 2 * LEAST_LEVEL_PX:
        larger = levels[-1]
        half_rows = (larger[::2] + larger[1::2]) / 2
        levels.append((half_rows[:, ::2] + half_rows[:, 1::2]) / 2)
    return [np.pad(level, [(1, 1), (1, 1), (0, 0)]) for level in levels]


def _resampled(mipmap: Mipmap, row_share: Floats, column_share: Floats, *, size_px: int) -> Floats:
    """Bilinearly interpolated pixels (r, c, C) at shares (r,), (c,) of the sides of a picture; 0 outside of it.

    `size_px` is the side that the picture is drawn with. The level of the mipmap is the first one of less than twice
    this size.
    """
    largest_px = 2 * max(size_px, LEAST_LEVEL_PX)
    level = next(level for level in mipmap if _side_px(level) < largest_px)
    side_px = _side_px(level)
    # Pixel centres are at integers, and that of the rim is at 0.
    y = np.clip(row_share * side_px + 0.5, 0, side_px + 0.999)
    x = np.clip(column_share * side_px + 0.5, 0, side_px + 0.999)
    top = y.astype(np.int32)
    left = x.astype(np.int32)
    lower_share = (y - top).astype(np.float32)[:, None, None]
    right_share = (x - left).astype(np.float32)[None, :, None]
    left_share = 1 - right_share
    upper_share = 1 - lower_share

    upper_rows = level[top]
    lower_rows = level[top + 1]
    upper = upper_rows[:, left] * left_share + upper_rows[:, left + 1] * right_share
    lower = lower_rows[:, left] * left_share + lower_rows[:, left + 1] * right_share
    return np.asarray(upper * upper_share + lower * lower_share, np.float32)


def _side_px(level: Floats) -> int:
    """The side of a level of a mipmap without its rim."""
    return len(level) - 2
