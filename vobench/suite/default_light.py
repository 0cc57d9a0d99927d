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
    """The light for a scene without any.

    `lamps` are the lamps of a scene indoors; none means daylight.
    `absorption_m2` is the area of a black surface that absorbs as much light as the faces seen from the free space.
    `has_windows` is whether the sky is seen from below a ceiling.
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
    reached_faces = _reached_faces(eyes_m, caster)
    is_reached = reached_faces >= 0
    shell_m2 = float(absorption_m2[np.unique(reached_faces[is_reached])].sum())
    has_windows = float((~is_reached).mean()) > LEAST_OUTSIDE

    above = caster.hits(eyes_m, -downward_directions(len(eyes_m)))
    is_covered = above.face >= 0
    is_indoors = is_covered.mean() >= LEAST_COVERED
    if not is_indoors:
        return DefaultLight((), shell_m2)
    ceilings_m = BODY_M + above.distance[is_covered]  # above the floor
    lamps = _lamps(eyes_m[is_covered], ceilings_m, caster, power_lm=ROOM_LX * shell_m2)
    return DefaultLight(lamps, shell_m2, has_windows)


def _lamps(eyes_m: Array, ceilings_m: Array, caster: RayCaster, *, power_lm: float) -> tuple[PanelLamp, ...]:
    """Lamps above some of the eyes (N, 3), below ceilings at heights (N,), with a total power."""
    is_high = ceilings_m > LOW_CEILING * np.percentile(ceilings_m, 80)
    lamps_m, sides_m = _hung(eyes_m[is_high], ceilings_m[is_high], caster)
    chosen = _spread(lamps_m, eyes_m[is_high], caster)
    power_of_lamp_lm = float(f"{power_lm / len(chosen):.3g}")
    lamps = []
    for number, index in enumerate(chosen, 1):
        x_m, y_m, z_m = lamps_m[index].round(3).tolist()
        side_m = float(sides_m[index].round(3))
        lamp = PanelLamp(
            name=f"lamp_{number}",
            center_m=(x_m, y_m, z_m),
            size_m=(side_m, side_m),
            power_lm=power_of_lamp_lm,
        )
        lamps.append(lamp)
    return tuple(lamps)


def _places(floor: FloorMap) -> Array:
    """About MOST_PLACES free places (N, 2) on a regular grid, or all of them if none is on the grid."""
    rows, columns = np.nonzero(floor.free)
    step = max(1, int(np.ceil(np.sqrt(len(rows) / MOST_PLACES))))
    places_m = np.column_stack([floor.x_m[columns], floor.y_m[rows]])
    # The grid begins half a step from the edge of the map. If it misses small free places, it begins at the edge.
    for offset in (step // 2, 0):
        is_on_grid = (rows % step == offset) & (columns % step == offset)
        if is_on_grid.any():
            return np.asarray(places_m[is_on_grid])
    return places_m


def _reached_faces(eyes_m: Array, caster: RayCaster) -> Indices:
    """The faces (R,) that rays from places (N, 3) in all directions reach, -1 for none."""
    directions = unit(np.random.default_rng(0).standard_normal((len(eyes_m) * SHELL_RAYS, 3)))
    return caster.nearest(np.repeat(eyes_m, SHELL_RAYS, axis=0), directions)


def _hung(eyes_m: Array, ceilings_m: Array, caster: RayCaster) -> tuple[Array, Array]:
    """Possible lamps: middles (N, 3) below the ceilings above eyes (N, 3), and sides (N,) for which there is room.

    `ceilings_m` (N,) are the heights of the ceilings above the floor.
    """
    lamps_m = eyes_m.copy()
    lamps_m[:, 2] += (1 - LAMP_GAP) * ceilings_m - BODY_M
    sides_m = np.clip(LAMP_SIDE * ceilings_m, SMALLEST_SIDE_M, LARGEST_SIDE_M)
    for angle_rad in np.arange(8) * np.pi / 4:
        direction = np.array([np.cos(angle_rad), np.sin(angle_rad), 0.0])
        hits = caster.hits(lamps_m, np.tile(direction, (len(lamps_m), 1)))
        to_wall_m = np.where(hits.face < 0, np.inf, hits.distance)
        room_m = ROOM_FOR_LAMP * np.maximum(to_wall_m, SMALLEST_SIDE_M / 2)
        sides_m = np.minimum(sides_m, 2 * room_m)
    return lamps_m, sides_m


def _spread(lamps_m: Array, eyes_m: Array, caster: RayCaster) -> list[int]:
    """The indices of the possible lamps (N, 3) to hang, so that each eye (N, 3) gets enough light.

    A greedy choice: the next lamp is the one that adds most light, of which only ENOUGH_LIGHT counts at each eye.
    """
    light = _relative_illuminance(lamps_m, eyes_m, caster)  # (lamp, eye)
    chosen = list[int]()
    received = np.zeros(len(eyes_m))
    while len(chosen) < MOST_LAMPS:
        before = np.minimum(received, ENOUGH_LIGHT)
        after = np.minimum(received + light, ENOUGH_LIGHT)
        gains = (after - before).mean(1)
        best = int(gains.round(9).argmax())
        is_worthwhile = gains[best] >= LEAST_GAIN * ENOUGH_LIGHT
        if chosen and not is_worthwhile:
            break
        chosen.append(best)
        received = received + light[best]
    return chosen


def _relative_illuminance(lamps_m: Array, eyes_m: Array, caster: RayCaster) -> Array:
    """The illuminance (lamp, eye) of level ground at eyes (N, 3), relative to that straight below a lamp (N, 3)."""
    count = len(lamps_m)
    from_lamps_m = np.repeat(lamps_m, count, axis=0)
    to_eyes_m = np.tile(eyes_m, (count, 1))
    is_seen = ~caster.occluded(from_lamps_m, to_eyes_m).reshape(count, count)
    offset_m = eyes_m[None] - lamps_m[:, None]  # (lamp, eye, 3)
    distance_m2 = (offset_m**2).sum(-1)
    height_m = np.abs(offset_m[..., 2])
    # A level panel gives level ground an illuminance that falls as the fourth power of the cosine.
    squared_cosine = height_m**2 / np.maximum(distance_m2, 1e-9)
    return np.asarray(is_seen * squared_cosine**2)
