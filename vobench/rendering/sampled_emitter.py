"""Emitters that are approximated by a few samples, from which moving bodies cast shadows."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.rendering.array_types import Mask, Rows
from vobench.rendering.geometry import BoundingSphere, bounding_sphere, sample_points, sphere_directions
from vobench.rendering.light_emitter import emitters
from vobench.rendering.solid_angle import Rectangle, rectangle
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.mesh import face_corners

# The number of samples per metre of the radius of a panel and of a pane, and the limits of this number.
PER_RADIUS_M = 14
PANE_PER_RADIUS_M = 5
FEWEST_SAMPLES = 2
PANEL_SAMPLES = 9
OPEN_SKY_SAMPLES = 24
GOLDEN = (0.7548776662, 0.5698402910)  # steps of a low-discrepancy sequence in the unit square: Roberts (2018), R2


@dataclass(frozen=True, slots=True)
class SampledEmitter:
    """An emitter, approximated by K samples.

    `light` is the index of the light that the emitter belongs to.
    `ball` is the bounding sphere of the emitter; its radius is infinite for the open sky.
    `places` (K, 4) are homogeneous: a position and 1, or the direction towards an infinitely distant sample and 0.
    `axes` (K, 4) are the normal of a one-sided emitter and 0, or the normal of a two-sided pane and 1. They are 0 for
    an emitter that radiates equally in all directions.
    `strength` (K,) is the illuminance at normal incidence times the squared distance. It is the area for a pane, since
    the luminance of the sky depends on the direction, and 1 for a hard emitter.
    `is_hard` is whether the emitter casts hard shadows. Its illuminance is then computed at each point instead of at
    the probes.
    """

    light: int
    ball: BoundingSphere
    places: Array
    axes: Array
    strength: Array
    is_hard: bool = False


def sampled_emitters(
    lights: Sequence[Light], visibility: Visibility, suns_ns: Sequence[float], most_samples: int = OPEN_SKY_SAMPLES
) -> list[SampledEmitter]:
    """The emitters of all lights, in the order of the lights. Each has at most `most_samples` samples.

    `suns_ns` (L,) is the time at which the direction of a moving sun is evaluated.
    """
    result = list[SampledEmitter]()
    for index, light in enumerate(lights):
        match light:
            case AreaLight():
                result.append(_panel(index, light))
            case PointLight() | SpotLight():
                ball = BoundingSphere(light.position_m, 0.0)
                result.append(_hard(index, ball, place=[*light.position_m, 1.0]))
            case Sun():
                [emitter] = emitters(light, visibility, t_ns=suns_ns[index])
                direction = light.direction(suns_ns[index])
                result.append(_hard(index, emitter.ball, place=[*direction, 0.0]))
            case Sky():
                result += _sky_panes(index, visibility)
                result.append(_open_sky(index, light))
    return [_with_fewer(emitter, most_samples) for emitter in result]


def _with_fewer(emitter: SampledEmitter, most: int) -> SampledEmitter:
    """The emitter with at most `most` of its samples; the strengths are scaled to compensate for the others."""
    count = len(emitter.places)
    if count <= most:
        return emitter
    rows = np.linspace(0, count - 1, most).astype(int)
    return replace(
        emitter,
        places=emitter.places[rows],
        axes=emitter.axes[rows],
        strength=emitter.strength[rows] * count / most,
    )


def _panel(index: int, light: AreaLight) -> SampledEmitter:
    """An area light as an emitter; each sample has the normal of the nearest face."""
    corners_m = face_corners(light.mesh)
    ball = bounding_sphere(corners_m)
    points_m = _distributed_points(corners_m, _sample_count(PER_RADIUS_M * ball.radius_m))
    count = len(points_m)

    middles_m = corners_m.mean(1)
    distances_m = np.linalg.norm(points_m[:, None] - middles_m, axis=2)  # (K, F)
    nearest_face = distances_m.argmin(1)
    axes = np.column_stack([face_normals(corners_m)[nearest_face], np.zeros(count)])
    strength = np.full(count, light.luminance_cd_m2 * areas_m2(corners_m).sum() / count)
    return SampledEmitter(index, ball, _positions(points_m), axes, strength)


def _hard(index: int, ball: BoundingSphere, *, place: Sequence[float]) -> SampledEmitter:
    """An emitter with one sample, which casts hard shadows."""
    return SampledEmitter(index, ball, np.array([place]), np.zeros((1, 4)), np.ones(1), is_hard=True)


def _sky_panes(index: int, visibility: Visibility) -> list[SampledEmitter]:
    """The emitters of a sky that are panes through which it is visible."""
    result = []
    for pane in visibility.sky_panes:
        ball = bounding_sphere(pane.corners_m)
        points_m = _distributed_points(pane.corners_m, _sample_count(PANE_PER_RADIUS_M * ball.radius_m))
        count = len(points_m)
        axes = np.tile([*pane.normal, 1.0], (count, 1))
        strength = np.full(count, areas_m2(pane.corners_m).sum() / count)
        result.append(SampledEmitter(index, ball, _positions(points_m), axes, strength))
    return result


def _open_sky(index: int, light: Sky) -> SampledEmitter:
    """The emitter of a sky that is visible without a pane. Its samples are directions in the upper hemisphere."""
    directions = sphere_directions(2 * OPEN_SKY_SAMPLES)[:OPEN_SKY_SAMPLES]  # they begin at the zenith
    places = np.column_stack([directions, np.zeros(OPEN_SKY_SAMPLES)])
    strength = 2 * np.pi / OPEN_SKY_SAMPLES * light.luminance_cd_m2(directions)
    everywhere = BoundingSphere(np.zeros(3), np.inf)
    return SampledEmitter(index, everywhere, places, np.zeros((OPEN_SKY_SAMPLES, 4)), strength)


def _positions(points_m: Array) -> Array:
    """Points (K, 3) as homogeneous places (K, 4)."""
    return np.column_stack([points_m, np.ones(len(points_m))])


def _sample_count(wanted: float) -> int:
    """The number of samples that is nearest to `wanted` within the limits."""
    return int(np.clip(np.rint(wanted), FEWEST_SAMPLES, PANEL_SAMPLES))


def _distributed_points(corners_m: Array, count: int) -> Array:
    """About `count` points (K, 3) that are distributed over triangles. Their mean is the centroid of the triangles.

    On a rectangle, they are the centres of nearly square cells.
    """
    face = rectangle(corners_m)
    if face is not None:
        return _cell_centres(face, count)
    steps = np.arange(count)[:, None] * GOLDEN + 0.5
    a, b = (steps % 1).T
    points_m = sample_points(corners_m, a, b)
    area_m2 = areas_m2(corners_m)
    centroid_m = area_m2 @ corners_m.mean(1) / area_m2.sum()
    return np.asarray(points_m + centroid_m - points_m.mean(0))


def _cell_centres(face: Rectangle, count: int) -> Array:
    """The centres (K, 3) of about `count` nearly square cells of a rectangle."""
    width_m = np.linalg.norm(face.edge_u_m)
    length_m = np.linalg.norm(face.edge_v_m)
    columns = int(np.clip(np.rint(np.sqrt(count * width_m / length_m)), 1, count))
    rows = max(1, count // columns)
    column_shares = (np.arange(columns) + 0.5) / columns
    row_shares = (np.arange(rows) + 0.5) / rows
    u, v = np.meshgrid(column_shares, row_shares)
    return np.asarray(face.corner_m + u.reshape(-1, 1) * face.edge_u_m + v.reshape(-1, 1) * face.edge_v_m)


@dataclass(frozen=True, slots=True)
class EmitterSamples:
    """The K samples of several emitters, one emitter after the other.

    `places`, `axes` and `strength` are as in `SampledEmitter`. `light`, `is_hard` and `is_open_sky` (K,) are those of
    the emitter of each sample.
    """

    places: Array
    axes: Array
    strength: Array
    light: Rows
    is_hard: Mask
    is_open_sky: Mask


def joined_samples(emitters: Sequence[SampledEmitter]) -> EmitterSamples:
    """The samples of all emitters."""
    if not emitters:
        no_places = np.zeros((0, 4))
        no_light = np.zeros(0, np.int64)
        return EmitterSamples(no_places, no_places, np.zeros(0), no_light, np.zeros(0, bool), np.zeros(0, bool))
    counts = [len(emitter.places) for emitter in emitters]
    is_open_sky = [bool(np.isinf(emitter.ball.radius_m)) and not emitter.is_hard for emitter in emitters]
    return EmitterSamples(
        places=np.concatenate([emitter.places for emitter in emitters]),
        axes=np.concatenate([emitter.axes for emitter in emitters]),
        strength=np.concatenate([emitter.strength for emitter in emitters]),
        light=np.repeat([emitter.light for emitter in emitters], counts),
        is_hard=np.repeat([emitter.is_hard for emitter in emitters], counts),
        is_open_sky=np.repeat(is_open_sky, counts),
    )
