"""Lights for a model that has none: lamps below its ceilings, or the sun and the sky where it has no ceiling."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.geometry.vector import unit
from vobench.rendering.array_types import Indices
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import Scene, triangles
from vobench.suite.free_space import BODY_M, FloorMap, at_height, downward_directions, floor_map
from vobench.suite.scene_spec import PanelLamp, SkySpec, SunSpec
from vobench.suite.viewpoint import is_place

DAYLIGHT_SUN = SunSpec(illuminance_lx=30_000, azimuth_deg=30, elevation_deg=50)
DAYLIGHT_SKY = SkySpec(illuminance_lx=8_000, kind="clear")
DUSK_SKY = SkySpec(illuminance_lx=400)  # outside the windows of a place with lamps, which would otherwise be black
ROOM_LX = 400.0

MOST_PLACES = 300  # on the floor, that lamps may hang above and should light
LEAST_COVERED = 0.5  # share of the floor below a ceiling, from which a scene is indoors
LOW_CEILING = 0.5  # of the usual height; what is lower is a table or a shelf
SHELL_RAYS = 64  # from each place
LEAST_OUTSIDE = 0.005  # share of these rays that leave a place with windows

MOST_LAMPS = 16
ENOUGH_LIGHT = 0.15  # of the illuminance straight below a lamp, that each place should have
LEAST_GAIN = 0.03  # of ENOUGH_LIGHT, in the mean over all places, that a further lamp adds
LAMP_GAP = 0.03  # between lamp and ceiling, in heights of the ceiling
LAMP_SIDE = 0.2  # in heights of the ceiling
SMALLEST_SIDE_M = 0.1
LARGEST_SIDE_M = 2.0
ROOM_FOR_LAMP = 0.7  # of the distance to the nearest wall or shelf, that half a lamp may take up


@dataclass(frozen=True, slots=True)
class DefaultLight:
    """Either lamps, or none for daylight; and the area that absorbs light, of faces seen from the free space.

    has_windows: whether the sky is seen from below a ceiling.
    """

    lamps: tuple[PanelLamp, ...]
    absorption_m2: float
    has_windows: bool = False


def default_light(shape: Scene, absorption: Array) -> DefaultLight:
    """The light for a scene without any; `absorption` (T,) is the share of light that each of its things absorbs.

    Lamps give ROOM_LX in a closed room of the area A and the absorption a of the shell: their total power is
    ROOM_LX A a.
    """
    faces = triangles(shape, t_ns=0)
    caster = RayCaster(faces)
    floor = floor_map(faces, caster)
    absorption_m2 = areas_m2(faces.corners_m) * absorption[faces.thing]  # (F,)
    if floor is None or not is_place(faces, caster, floor.largest_circle()):
        return DefaultLight((), float(absorption_m2.sum()))

    eyes_m = at_height(_places(floor), floor.floor_m + BODY_M)
    reached = _reached_faces(eyes_m, caster)
    shell_m2 = float(absorption_m2[np.unique(reached[reached >= 0])].sum())
    has_windows = float((reached < 0).mean()) > LEAST_OUTSIDE
    above = caster.hits(eyes_m, -downward_directions(len(eyes_m)))
    is_covered = above.face >= 0
    if is_covered.mean() < LEAST_COVERED:
        return DefaultLight((), shell_m2)

    eyes_m = eyes_m[is_covered]
    heights_m = BODY_M + above.distance[is_covered]  # of the ceiling above the floor
    is_high = heights_m > LOW_CEILING * np.percentile(heights_m, 80)
    lamps_m, sides_m = _hung(eyes_m[is_high], heights_m[is_high], caster)
    chosen = _spread(lamps_m, eyes_m[is_high], caster)
    power_lm = float(f"{ROOM_LX * shell_m2 / len(chosen):.3g}")

    lamps = list[PanelLamp]()
    for number, place in enumerate(chosen, 1):
        x_m, y_m, z_m = lamps_m[place].round(3).tolist()
        side_m = float(sides_m[place].round(3))
        size_m = (side_m, side_m)
        lamps.append(PanelLamp(name=f"lamp_{number}", center_m=(x_m, y_m, z_m), size_m=size_m, power_lm=power_lm))
    return DefaultLight(tuple(lamps), shell_m2, has_windows)


def _places(floor: FloorMap) -> Array:
    """At most MOST_PLACES free places (N, 2), on a regular grid."""
    rows, columns = np.nonzero(floor.free)
    step = max(1, int(np.ceil(np.sqrt(len(rows) / MOST_PLACES))))
    for offset in (step // 2, 0):
        is_on_grid = (rows % step == offset) & (columns % step == offset)
        if is_on_grid.any():
            rows = rows[is_on_grid]
            columns = columns[is_on_grid]
            break
    return np.column_stack([floor.x_m[columns], floor.y_m[rows]])


def _reached_faces(eyes_m: Array, caster: RayCaster) -> Indices:
    """The faces (R,) that rays from places (N, 3) in all directions reach, -1 for none."""
    directions = unit(np.random.default_rng(0).standard_normal((len(eyes_m) * SHELL_RAYS, 3)))
    return caster.nearest(np.repeat(eyes_m, SHELL_RAYS, axis=0), directions)


def _hung(eyes_m: Array, heights_m: Array, caster: RayCaster) -> tuple[Array, Array]:
    """Lamps (N, 3) below the ceilings above places (N, 3), and sides (N,) that fit between walls and shelves."""
    lamps_m = eyes_m.copy()
    lamps_m[:, 2] += (1 - LAMP_GAP) * heights_m - BODY_M
    sides_m = np.clip(LAMP_SIDE * heights_m, SMALLEST_SIDE_M, LARGEST_SIDE_M)
    for angle in np.arange(8) * np.pi / 4:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        hits = caster.hits(lamps_m, np.tile(direction, (len(lamps_m), 1)))
        distance_m = np.where(hits.face < 0, np.inf, hits.distance)
        sides_m = np.minimum(sides_m, 2 * ROOM_FOR_LAMP * np.maximum(distance_m, SMALLEST_SIDE_M / 2))
    return lamps_m, sides_m


def _spread(lamps_m: Array, eyes_m: Array, caster: RayCaster) -> list[int]:
    """The lamps to hang, of those possible (N, 3), so that each place (N, 3) sees enough of them.

    Each in turn is the one that adds most, counted up to ENOUGH_LIGHT at each place.
    """
    count = len(lamps_m)
    from_lamp = np.repeat(lamps_m, count, axis=0)
    to_eye = np.tile(eyes_m, (count, 1))
    is_seen = ~caster.occluded(from_lamp, to_eye).reshape(count, count)
    offset_m = eyes_m[None] - lamps_m[:, None]  # (lamp, eye, 3)
    distance_m2 = (offset_m**2).sum(-1)
    height_m = np.abs(offset_m[..., 2])
    # A level panel gives level ground an illuminance that falls as the fourth power of the cosine.
    light = is_seen * (height_m**2 / np.maximum(distance_m2, 1e-9)) ** 2

    chosen = list[int]()
    reached = np.zeros(count)
    while len(chosen) < MOST_LAMPS:
        before = np.minimum(reached, ENOUGH_LIGHT)
        after = np.minimum(reached + light, ENOUGH_LIGHT)
        gains = (after - before).mean(1)
        best = int(gains.round(9).argmax())
        if chosen and gains[best] < LEAST_GAIN * ENOUGH_LIGHT:
            break
        chosen.append(best)
        reached = reached + light[best]
    return chosen
