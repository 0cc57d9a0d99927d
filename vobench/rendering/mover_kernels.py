"""Compiled kernels of the shadows of moving bodies: their shadow maps, the light they block, and the light on them."""

import math
from typing import NamedTuple

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled, float32
from vobench.rendering.ray_kernels import fresnel_of

ZERO = float32(0)
ONE = float32(1)
HALF = float32(0.5)
NEAR_M = float32(0.05)  # the distance from a sample at which the nearness in its shadow map is 1
LEAST_NEARNESS = float32(1e-6)  # a point counts as at least this near, so that an empty map hides nothing
CLEAR_M = float32(0.004)  # the distance towards the light at which a stationary point looks for bodies
OWN_M = float32(0.025)  # the same for a point on a body, whose shadow map shows the body coarsely
STEEPEST = float32(0.999)  # the largest sine of the half-angle of a cone, for points near the emitter
NEGLIGIBLE_LOSS = float32(1 / 400)  # the largest share of the light at a point whose loss is invisible
SMALLEST_M2 = float32(1e-6)  # the smallest squared distance of a sample
PART_MARGIN = float32(1.1)  # the radius around a part of a body in which its shadow map may show the part
TILE = 32  # the side in texels of the tiles of the light map that are marked as changed


class MovingParts(NamedTuple):
    """The moving bodies, as S spheres around their parts: `centres_m` (S, 3), `radius_m` (S,), `body` (S,)."""

    centres_m: Floats
    radius_m: Floats
    body: Indices


class EmitterAt(NamedTuple):
    """An emitter at an instant, with K samples and the shadow maps of B bodies.

    `centre_m` (3,) and `radius_m` are its bounding sphere; the radius is negative for the open sky.
    `places`, `axes` (K, 4) are as in `SampledEmitter`; `strength` (K,) is the strength that reaches the bodies.
    `reach` (N, K) is the strength that reaches each of N probes.
    `map_of` (B, K) is the index of each shadow map, -1 if there is none.
    """

    centre_m: Floats
    radius_m: float
    is_hard: bool
    places: Floats
    axes: Floats
    strength: Floats
    reach: Floats
    map_of: Indices


class ShadowMaps(NamedTuple):
    """M shadow maps: matrices (M, 3, 4), as `shadow_matrices` defines them, and nearness (M, side, side).

    The nearness of a body is NEAR_M over its depth in metres for a sample with a position. For a sample with a
    direction, it is the third coordinate of the matrix. It is 0 where there is no body.
    """

    matrices: Floats
    nearness: Floats


class LightMap(NamedTuple):
    """A light map (H, W, 3) that is changed in place, and which of its tiles (rows, columns) have changed."""

    light_lx: Floats
    is_changed: Mask


@compiled
def draw_map(triangles_m: Floats, matrix: Floats, has_position: bool, nearness: Floats) -> None:
    """Draw triangles (T, 3, 3) into a shadow map (side, side): the largest nearness at the centre of each pixel.

    Pixels are found by the signs of homogeneous edge functions, so that triangles need not be clipped.
    Source: Olano and Greer, Triangle Scan Conversion using 2D Homogeneous Coordinates, 1997.
    """
    side = len(nearness)
    corner = np.empty((3, 3), np.float32)  # x, y and w of each corner
    depth = np.empty(3, np.float32)
    edge = np.empty((3, 3), np.float32)
    for triangle in range(len(triangles_m)):
        lowest = np.float32(side)
        highest = ZERO
        leftmost = np.float32(side)
        rightmost = ZERO
        is_ahead = True
        for nth in range(3):
            for row in range(3):
                value = matrix[row, 3]
                for axis in range(3):
                    value += matrix[row, axis] * triangles_m[triangle, nth, axis]
                corner[nth, row] = value
            along = corner[nth, 2]
            w = along if has_position else ONE
            corner[nth, 2] = w
            depth[nth] = NEAR_M if has_position else along
            if w <= ZERO:
                is_ahead = False
                continue
            column_px = (HALF * corner[nth, 0] / w + HALF) * np.float32(side)
            row_px = (HALF * corner[nth, 1] / w + HALF) * np.float32(side)
            leftmost = min(leftmost, column_px)
            rightmost = max(rightmost, column_px)
            lowest = min(lowest, row_px)
            highest = max(highest, row_px)

        for nth in range(3):
            second = corner[(nth + 1) % 3]
            third = corner[(nth + 2) % 3]
            edge[nth, 0] = second[1] * third[2] - second[2] * third[1]
            edge[nth, 1] = second[2] * third[0] - second[0] * third[2]
            edge[nth, 2] = second[0] * third[1] - second[1] * third[0]
        determinant = ZERO
        for axis in range(3):
            determinant += corner[0, axis] * edge[0, axis]
        if determinant == ZERO:
            continue

        first_row = 0
        last_row = side - 1
        first_column = 0
        last_column = side - 1
        if is_ahead:
            first_row = max(math.floor(lowest - HALF), 0)
            last_row = min(math.ceil(highest - HALF), side - 1)
            first_column = max(math.floor(leftmost - HALF), 0)
            last_column = min(math.ceil(rightmost - HALF), side - 1)
        _draw_pixels(edge, depth, determinant, first_row, last_row, first_column, last_column, nearness)


@compiled
def _draw_pixels(
    edge: Floats,
    depth: Floats,
    determinant: float,
    first_row: int,
    last_row: int,
    first_column: int,
    last_column: int,
    nearness: Floats,
) -> None:
    """Draw the pixels of a triangle, given its edge functions (3, 3) and the depth (3,) of its corners."""
    side = len(nearness)
    step = np.float32(2) / np.float32(side)
    inverse = ONE / determinant
    weight = np.empty(3, np.float32)  # of each corner, divided by w
    growth = np.empty(3, np.float32)  # of each weight, from pixel to pixel
    for nth in range(3):
        growth[nth] = edge[nth, 0] * inverse * step
    for row in range(first_row, last_row + 1):
        y = (np.float32(row) + HALF) * step - ONE
        x = (np.float32(first_column) + HALF) * step - ONE
        for nth in range(3):
            weight[nth] = (edge[nth, 0] * x + edge[nth, 1] * y + edge[nth, 2]) * inverse
        for column in range(first_column, last_column + 1):
            ahead = np.float32(column - first_column)
            first = weight[0] + ahead * growth[0]
            second = weight[1] + ahead * growth[1]
            third = weight[2] + ahead * growth[2]
            if first < ZERO or second < ZERO or third < ZERO:
                continue
            pixel_nearness = first * depth[0] + second * depth[1] + third * depth[2]
            if pixel_nearness <= ONE:
                nearness[row, column] = max(nearness[row, column], pixel_nearness)


@compiled
def hidden_share(maps: ShadowMaps, number: int, has_position: bool, x: float, y: float, z: float) -> float:
    """The share of a point that a body hides from a sample, interpolated between four pixels of a shadow map."""
    matrices = maps.matrices
    nearness = maps.nearness
    along = (
        matrices[number, 2, 0] * x + matrices[number, 2, 1] * y + matrices[number, 2, 2] * z + matrices[number, 2, 3]
    )
    w = along if has_position else ONE
    if w <= ZERO:
        return ZERO
    u = matrices[number, 0, 0] * x + matrices[number, 0, 1] * y + matrices[number, 0, 2] * z + matrices[number, 0, 3]
    v = matrices[number, 1, 0] * x + matrices[number, 1, 1] * y + matrices[number, 1, 2] * z + matrices[number, 1, 3]
    if abs(u) >= w or abs(v) >= w:
        return ZERO
    side = nearness.shape[1]
    last = np.float32(side) - HALF
    column_px = min(max((HALF * u / w + HALF) * np.float32(side), HALF), last) - HALF
    row_px = min(max((HALF * v / w + HALF) * np.float32(side), HALF), last) - HALF
    column = min(int(column_px), side - 2)
    row = min(int(row_px), side - 2)
    u_share = column_px - np.float32(column)
    v_share = row_px - np.float32(row)

    point_nearness = max(NEAR_M / w if has_position else along, LEAST_NEARNESS)
    upper = ZERO
    if nearness[number, row, column] > point_nearness:
        upper += ONE - u_share
    if nearness[number, row, column + 1] > point_nearness:
        upper += u_share
    lower = ZERO
    if nearness[number, row + 1, column] > point_nearness:
        lower += ONE - u_share
    if nearness[number, row + 1, column + 1] > point_nearness:
        lower += u_share
    share: float = upper + v_share * (lower - upper)
    return share


@compiled
def arriving_of(
    emitter: EmitterAt,
    sample: int,
    x: float,
    y: float,
    z: float,
    normal_x: float,
    normal_y: float,
    normal_z: float,
) -> tuple[float, float, float, float]:
    """The illuminance of a point by a sample of unit strength, and the unit vector towards the sample."""
    places = emitter.places
    axes = emitter.axes
    has_position = places[sample, 3]
    to_x = places[sample, 0] - has_position * x
    to_y = places[sample, 1] - has_position * y
    to_z = places[sample, 2] - has_position * z
    squared = max(to_x * to_x + to_y * to_y + to_z * to_z, SMALLEST_M2)
    inverse = ONE / math.sqrt(squared)
    to_x *= inverse
    to_y *= inverse
    to_z *= inverse
    cosine = max(normal_x * to_x + normal_y * to_y + normal_z * to_z, ZERO)
    axis_x = axes[sample, 0]
    axis_y = axes[sample, 1]
    axis_z = axes[sample, 2]
    leaving = ONE
    if axis_x != ZERO or axis_y != ZERO or axis_z != ZERO:
        leaving = -(axis_x * to_x + axis_y * to_y + axis_z * to_z)
        leaving = abs(leaving) if axes[sample, 3] > ZERO else max(leaving, ZERO)
    light = cosine * leaving
    if has_position > ZERO:
        light *= inverse * inverse
    return light, to_x, to_y, to_z


@compiled
def may_hide(
    occluders: MovingParts,
    part: int,
    part_radius_m: float,
    x: float,
    y: float,
    z: float,
    radius_m: float,
    end_m: Floats,
    end_radius_m: float,
) -> bool:
    """Whether a sphere of a part may touch a segment from a sphere of points to a sphere at the end.

    All such segments are inside a conical frustum around the line between the centres.
    """
    part_x = occluders.centres_m[part, 0] - x
    part_y = occluders.centres_m[part, 1] - y
    part_z = occluders.centres_m[part, 2] - z
    near_m = part_radius_m + radius_m
    squared = part_x * part_x + part_y * part_y + part_z * part_z
    if squared <= near_m * near_m:
        return True
    end_x = end_m[0] - x
    end_y = end_m[1] - y
    end_z = end_m[2] - z
    length_m = max(math.sqrt(end_x * end_x + end_y * end_y + end_z * end_z), LEAST_NEARNESS)
    along_m = (part_x * end_x + part_y * end_y + part_z * end_z) / length_m
    if along_m < -near_m or along_m > length_m + end_radius_m + near_m:
        return False
    aside_squared = max(squared - along_m * along_m, ZERO)
    sine = min((end_radius_m + radius_m) / length_m, STEEPEST)
    cone_m = near_m + sine * max(along_m, ZERO)
    is_touched: bool = aside_squared * (ONE - sine * sine) <= cone_m * cone_m
    return is_touched


@compiled
def may_hide_direction(
    occluders: MovingParts,
    part: int,
    part_radius_m: float,
    x: float,
    y: float,
    z: float,
    radius_m: float,
    place: Floats,
) -> bool:
    """Whether a sphere of a part may touch a ray in a direction (3,) from a sphere of points."""
    part_x = occluders.centres_m[part, 0] - x
    part_y = occluders.centres_m[part, 1] - y
    part_z = occluders.centres_m[part, 2] - z
    near_m = part_radius_m + radius_m
    along_m = part_x * place[0] + part_y * place[1] + part_z * place[2]
    squared = part_x * part_x + part_y * part_y + part_z * part_z
    is_touched: bool = along_m >= -near_m and squared - along_m * along_m <= near_m * near_m
    return is_touched


@compiled
def hiding_pairs(
    occluders: MovingParts, emitter: EmitterAt, centre_m: Floats, radius_m: float, pair_sample: Rows, pair_body: Rows
) -> int:
    """Write the samples and bodies of which the body may hide the sample from a sphere of points. How many they are.

    The pairs are written to `pair_sample` and `pair_body`, sample by sample.
    """
    x = centre_m[0]
    y = centre_m[1]
    z = centre_m[2]
    count = 0
    for sample in range(len(emitter.places)):
        place = emitter.places[sample]
        for part in range(len(occluders.body)):
            body = occluders.body[part]
            if emitter.map_of[body, sample] < 0:
                continue
            if count > 0 and pair_sample[count - 1] == sample and pair_body[count - 1] == body:
                continue
            part_radius_m = PART_MARGIN * occluders.radius_m[part]
            if place[3] > ZERO:
                is_hiding = may_hide(occluders, part, part_radius_m, x, y, z, radius_m, place, ZERO)
            else:
                is_hiding = may_hide_direction(occluders, part, part_radius_m, x, y, z, radius_m, place)
            if is_hiding:
                pair_sample[count] = sample
                pair_body[count] = body
                count += 1
    return count


@compiled
def take_shaded(
    places_m: Floats,
    normals: Floats,
    rows: Indices,
    columns: Indices,
    width_px: Indices,
    steady_lx: Floats,
    direct_lx: Floats,
    blocks: Rows,
    block_size: int,
    block_centres_m: Floats,
    block_radius_m: Floats,
    occluders: MovingParts,
    emitter: EmitterAt,
    maps: ShadowMaps,
    colour: Floats,
    light_map: LightMap,
) -> None:
    """Subtract from a light map the light of an emitter that bodies hide from the sites in some blocks.

    Of P sites, `places_m` and `normals` (P, 3) are positions and normals, `rows` and `columns` (P,) the first texel,
    `width_px` (P,) the number of texels along each side, `steady_lx` (P,) the direct light of all steady lights and
    `direct_lx` (P,) that of the emitter at level 1. `blocks` (K,) are the indices of blocks of `block_size` sites, with
    bounding spheres of all blocks. `colour` (3,) is that of the emitter's light, times its level.
    """
    sample_count = len(emitter.places)
    most_pairs = sample_count * len(occluders.body)
    pair_sample = np.empty(most_pairs, np.int64)
    pair_body = np.empty(most_pairs, np.int64)
    for block in blocks:
        pair_count = hiding_pairs(
            occluders, emitter, block_centres_m[block], block_radius_m[block], pair_sample, pair_body
        )
        if pair_count == 0:
            continue
        first_site = block * block_size
        for site in range(first_site, min(first_site + block_size, len(rows))):
            if direct_lx[site] <= ZERO:
                continue
            share = _hidden_light(places_m, normals, site, emitter, maps, pair_count, pair_sample, pair_body)
            light_lx = direct_lx[site] * share
            if light_lx <= NEGLIGIBLE_LOSS * (steady_lx[site] + light_lx):
                continue
            for row in range(rows[site], rows[site] + width_px[site]):
                for column in range(columns[site], columns[site] + width_px[site]):
                    light_map.is_changed[row // TILE, column // TILE] = True
                    for channel in range(3):
                        rest_lx = light_map.light_lx[row, column, channel] - light_lx * colour[channel]
                        light_map.light_lx[row, column, channel] = max(rest_lx, ZERO)


@compiled
def _hidden_light(
    places_m: Floats,
    normals: Floats,
    site: int,
    emitter: EmitterAt,
    maps: ShadowMaps,
    pair_count: int,
    pair_sample: Rows,
    pair_body: Rows,
) -> float:
    """The share of an emitter's light at a site that bodies hide, given the pairs of samples and bodies to test.

    The body that hides most of the light of a sample counts, since bodies behind one another hide the same light.
    """
    x = places_m[site, 0]
    y = places_m[site, 1]
    z = places_m[site, 2]
    normal_x = normals[site, 0]
    normal_y = normals[site, 1]
    normal_z = normals[site, 2]
    hidden_lx = ZERO
    pair = 0
    while pair < pair_count:
        sample = pair_sample[pair]
        has_position = emitter.places[sample, 3] > ZERO
        light, to_x, to_y, to_z = arriving_of(emitter, sample, x, y, z, normal_x, normal_y, normal_z)
        most = ZERO
        while pair < pair_count and pair_sample[pair] == sample:
            if light > ZERO and most < ONE:
                number = emitter.map_of[pair_body[pair], sample]
                from_x = x + CLEAR_M * to_x
                from_y = y + CLEAR_M * to_y
                from_z = z + CLEAR_M * to_z
                most = max(most, hidden_share(maps, number, has_position, from_x, from_y, from_z))
            pair += 1
        hidden_lx += emitter.strength[sample] * light * most
    if hidden_lx <= ZERO:
        return ZERO
    all_lx = ZERO
    for sample in range(len(emitter.places)):
        light, _, _, _ = arriving_of(emitter, sample, x, y, z, normal_x, normal_y, normal_z)
        all_lx += emitter.strength[sample] * light
    return hidden_lx / all_lx


@compiled
def add_light_on_points(
    points_m: Floats,
    normals: Floats,
    eta: Floats,
    probe_place: Floats,
    hard_lx: Floats,
    occluders: MovingParts,
    body_count: int,
    emitter: EmitterAt,
    maps: ShadowMaps,
    colour: Floats,
    light_lx: Floats,
) -> None:
    """Add the light of an emitter to points on bodies (P, 3), less what other bodies and their own hide.

    `eta` (P,) are the refractive indices of coats, 0 without a coat. `probe_place` (P,) are coordinates among the
    probes. `hard_lx` (P,) is the illuminance by a hard emitter without movers. The sums are in `light_lx` (P, 3).
    """
    may_hide_point = np.empty(body_count, np.bool_)
    for point in range(len(points_m)):
        normal_x = normals[point, 0]
        normal_y = normals[point, 1]
        normal_z = normals[point, 2]
        x = points_m[point, 0]
        y = points_m[point, 1]
        z = points_m[point, 2]
        if emitter.is_hard and hard_lx[point] <= ZERO:
            continue
        if _is_behind(emitter, x, y, z, normal_x, normal_y, normal_z):
            continue
        _mark_hiding(occluders, emitter, x, y, z, may_hide_point)
        total_lx = ZERO
        for sample in range(len(emitter.places)):
            light, to_x, to_y, to_z = arriving_of(emitter, sample, x, y, z, normal_x, normal_y, normal_z)
            if emitter.is_hard:
                light = hard_lx[point]
            else:
                light *= _reach_at(emitter.reach, probe_place[point], sample)
                if eta[point] > ZERO and light > ZERO:
                    cosine = max(normal_x * to_x + normal_y * to_y + normal_z * to_z, ZERO)
                    mirrored: float = fresnel_of(min(cosine, ONE), eta[point])
                    light *= ONE - mirrored
            if light <= ZERO:
                continue
            from_x = x + OWN_M * (normal_x + to_x)
            from_y = y + OWN_M * (normal_y + to_y)
            from_z = z + OWN_M * (normal_z + to_z)
            hidden = _hidden_by_bodies(emitter, maps, sample, may_hide_point, from_x, from_y, from_z)
            total_lx += light * (ONE - hidden)
        for channel in range(3):
            light_lx[point, channel] += total_lx * colour[channel]


@compiled
def _is_behind(
    emitter: EmitterAt, x: float, y: float, z: float, normal_x: float, normal_y: float, normal_z: float
) -> bool:
    """Whether all of an emitter is behind the surface at a point."""
    if emitter.radius_m < 0:
        return False
    ahead_m = normal_x * (emitter.centre_m[0] - x)
    ahead_m += normal_y * (emitter.centre_m[1] - y)
    ahead_m += normal_z * (emitter.centre_m[2] - z)
    is_behind: bool = ahead_m <= -emitter.radius_m
    return is_behind


@compiled
def _hidden_by_bodies(
    emitter: EmitterAt, maps: ShadowMaps, sample: int, is_candidate: Mask, x: float, y: float, z: float
) -> float:
    """The share of a point that the candidates (B,) among the bodies hide from a sample."""
    has_position = emitter.places[sample, 3] > ZERO
    hidden = ZERO
    for body in range(len(is_candidate)):
        number = emitter.map_of[body, sample]
        if is_candidate[body] and number >= 0 and hidden < ONE:
            hidden = max(hidden, hidden_share(maps, number, has_position, x, y, z))
    return hidden


@compiled
def _mark_hiding(occluders: MovingParts, emitter: EmitterAt, x: float, y: float, z: float, marked: Mask) -> None:
    """Mark the bodies (B,) that may hide part of an emitter from a point."""
    marked[:] = False
    for part in range(len(occluders.body)):
        body = occluders.body[part]
        if marked[body]:
            continue
        if emitter.radius_m < 0:
            marked[body] = True
            continue
        radius_m = occluders.radius_m[part]
        marked[body] = may_hide(occluders, part, radius_m, x, y, z, ZERO, emitter.centre_m, emitter.radius_m)


@compiled
def _reach_at(reach: Floats, probe_place: float, sample: int) -> float:
    """The strength of a sample at a coordinate among the probes (N,), interpolated between two probes."""
    first = int(probe_place)
    second = min(first + 1, len(reach) - 1)
    share = probe_place - np.float32(first)
    strength: float = reach[first, sample] + share * (reach[second, sample] - reach[first, sample])
    return strength


@compiled
def mark_in_views(centres_m: Floats, radius_m: Floats, planes: Floats, margin_m: float, marked: Mask) -> None:
    """Mark the spheres (N,) that are in one of several views (V, K, 4), or at most a margin outside.

    Planes have unit normals that point inwards; a plane of zeros bounds nothing.
    """
    for sphere in range(len(radius_m)):
        reach_m = radius_m[sphere] + margin_m
        for view in range(len(planes)):
            is_inside = True
            for plane in planes[view]:
                height_m = plane[3]
                for axis in range(3):
                    height_m += plane[axis] * centres_m[sphere, axis]
                if height_m <= -reach_m:
                    is_inside = False
                    break
            if is_inside:
                marked[sphere] = True
                break
