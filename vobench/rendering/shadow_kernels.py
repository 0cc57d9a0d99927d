"""Compiled kernels of shadow rays: where they aim, what would arrive along them, and what does."""

import math

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled
from vobench.rendering.ray_kernels import ONE, STEP_U, STEP_V, fresnel_of

# Steps of an additive recurrence on texels' areas that fits none of the one on emitters: the golden ratio's.
FOOTPRINT_U = np.float32(0.3247179572)
FOOTPRINT_V = np.float32(0.6180339887)
HALF = np.float32(0.5)


@compiled
def places_in_cell(dither: Floats, cell: int, side: int, a: Floats, b: Floats) -> None:
    """Write where in a cell of side x side of the unit square each point (P,) aims, by its dither (P, 2)."""
    column = np.float32(cell % side)
    row = np.float32(cell // side)
    for point in range(len(dither)):
        jitter_u = dither[point, 0] + np.float32(cell) * STEP_U
        jitter_v = dither[point, 1] + np.float32(cell) * STEP_V
        a[point] = (column + jitter_u - np.float32(math.floor(jitter_u))) / np.float32(side)
        b[point] = (row + jitter_v - np.float32(math.floor(jitter_v))) / np.float32(side)


@compiled
def entering_light(
    vectors_m: Floats,
    strength: Floats,
    normals: Floats,
    planes: Floats,
    eta: Floats,
    light: Floats,
) -> None:
    """Write the illuminance (P,) that enters points from vectors (P, 3) if nothing hides what is there.

    `strength` (P,) is the illuminance square to each vector.
    """
    for point in range(len(vectors_m)):
        x = vectors_m[point, 0]
        y = vectors_m[point, 1]
        z = vectors_m[point, 2]
        light[point] = 0
        along_plane = x * planes[point, 0] + y * planes[point, 1] + z * planes[point, 2]
        along_normal = x * normals[point, 0] + y * normals[point, 1] + z * normals[point, 2]
        if along_plane <= 0 or along_normal <= 0 or strength[point] <= 0:
            continue
        cosine = along_normal / math.sqrt(x * x + y * y + z * z)
        entering = 1.0
        if eta[point] > 0:
            entering = 1 - fresnel_of(min(cosine, ONE), eta[point])
        light[point] = strength[point] * cosine * entering


@compiled
def sum_of_directions(normals: Floats, directions: Floats, sent: Floats, eta: float, light: Floats) -> None:
    """Write the illuminance (P,) that faces with normals (P, 3) receive from unit directions (D, 3) together.

    `sent` (D,) is the illuminance at normal incidence by each direction. Under a coat, whose refractive index is `eta`
    (0 without a coat), the result is the light that enters the coat.
    """
    for point in range(len(normals)):
        total = 0.0
        for number in range(len(directions)):
            cosine = 0.0
            for axis in range(3):
                cosine += normals[point, axis] * directions[number, axis]
            if cosine <= 0:
                continue
            entering = 1 - fresnel_of(min(cosine, 1.0), eta) if eta > 0 else 1.0
            total += cosine * entering * sent[number]
        light[point] = total


@compiled
def lit_rays(
    points_m: Floats,
    vectors_m: Floats,
    light: Floats,
    rows: Indices,
    origins_m: Floats,
    segments_m: Floats,
) -> int:
    """Write the rays of the points (P,) that light would reach, and the rows of these. How many they are."""
    count = 0
    for point in range(len(light)):
        if light[point] <= 0:
            continue
        rows[count] = point
        for axis in range(3):
            origins_m[count, axis] = points_m[point, axis]
            segments_m[count, axis] = vectors_m[point, axis]
        count += 1
    return count


@compiled
def spread_over_texels(
    dither: Floats,
    step_u_m: Floats,
    step_v_m: Floats,
    cell: int,
    rows: Indices,
    origins_m: Floats,
    segments_m: Floats,
) -> None:
    """Move the origins of rays (N, 3) from the middles of texels, at rows (N,), to somewhere on their areas."""
    for ray in range(len(rows)):
        point = rows[ray]
        place_u = dither[point, 1] + np.float32(cell) * FOOTPRINT_U
        place_v = dither[point, 0] + np.float32(cell) * FOOTPRINT_V
        along_u = place_u - np.float32(math.floor(place_u)) - HALF
        along_v = place_v - np.float32(math.floor(place_v)) - HALF
        for axis in range(3):
            aside_m = along_u * step_u_m[point, axis] + along_v * step_v_m[point, axis]
            origins_m[ray, axis] += aside_m
            segments_m[ray, axis] -= aside_m


@compiled
def add_arrived(
    rows: Indices,
    share: Floats,
    light: Floats,
    total: Floats,
    unshaded: Floats,
    passed: Floats,
    sent: Floats,
) -> None:
    """Add the light (P,) of a place on an emitter, of which the share (N,) arrives at rows (N,), to the sums (P,)."""
    for point in range(len(light)):
        unshaded[point] += light[point]
    for ray in range(len(rows)):
        point = rows[ray]
        total[point] += light[point] * share[ray]
        sent[point] += ONE
        if share[ray] > 0:
            passed[point] += ONE


@compiled
def dilate(marked: Mask, neighbours: Indices, result: Mask) -> None:
    """Write which points (P,) are marked or have a marked neighbour (4, P)."""
    first, second, third, fourth = neighbours
    for point in range(len(marked)):
        is_beside = marked[first[point]] or marked[second[point]] or marked[third[point]] or marked[fourth[point]]
        result[point] = marked[point] or is_beside


@compiled
def blur_along(values: Floats, before: Indices, after: Indices, result: Floats) -> None:
    """Write values (P,) averaged with those of the points before and after them."""
    for point in range(len(values)):
        result[point] = (2 * values[point] + values[before[point]] + values[after[point]]) / 4


@compiled
def aim_at_area(
    points_m: Floats,
    corner_m: Floats,
    edge_u_m: Floats,
    edge_v_m: Floats,
    normal: Floats,
    intensity_cd: float,
    a: Floats,
    b: Floats,
    vectors_m: Floats,
    strength: Floats,
) -> None:
    """Write vectors (P, 3) to places on a rectangle, by two numbers (P,), and the illuminance (P,) square to them."""
    for point in range(len(points_m)):
        ahead_m = 0.0
        squared_m2 = 0.0
        for axis in range(3):
            to_corner_m = corner_m[axis] - points_m[point, axis]
            step_m = to_corner_m + a[point] * edge_u_m[axis] + b[point] * edge_v_m[axis]
            vectors_m[point, axis] = step_m
            ahead_m -= step_m * normal[axis]
            squared_m2 += step_m * step_m
        squared_m2 = max(squared_m2, 1e-9)
        strength[point] = intensity_cd * max(ahead_m, 0.0) / (squared_m2 * math.sqrt(squared_m2))


CURVE_BITS = 10  # of each of two numbers, which together name a place along a Z-shaped curve
CURVE_CELLS = 1 << CURVE_BITS


@compiled
def along_curve_of(a: float, b: float) -> float:
    """A number in [0, 1) whose bits are by turns those of a and of b in [0, 1)."""
    first = int(a * CURVE_CELLS)
    second = int(b * CURVE_CELLS)
    place = 0
    for bit in range(CURVE_BITS - 1, -1, -1):
        place = 4 * place + 2 * ((first >> bit) & 1) + ((second >> bit) & 1)
    return place / (CURVE_CELLS * CURVE_CELLS)


@compiled
def aim_at_triangles(
    points_m: Floats,
    corners_m: Floats,
    normals: Floats,
    ends_m2: Floats,
    luminance_cd_m2: float,
    a: Floats,
    b: Floats,
    vectors_m: Floats,
    strength: Floats,
) -> None:
    """Write vectors (P, 3) to places on triangles (K, 3, 3), and the illuminance (P,) square to them.

    The triangles shine to the side of their normals (K, 3). `ends_m2` (K,) are sums of the areas up to each, so that
    places are spread evenly over all of them. Strata of the unit square of `a` and `b` (P,) are such of the mesh if
    near triangles are near to one another in their order.
    """
    whole_m2 = ends_m2[-1]
    intensity_cd = luminance_cd_m2 * whole_m2  # straight ahead
    for point in range(len(points_m)):
        sample_m2 = along_curve_of(a[point], b[point]) * whole_m2
        triangle = min(np.searchsorted(ends_m2, sample_m2, side="right"), len(ends_m2) - 1)
        start_m2 = ends_m2[triangle - 1] if triangle > 0 else 0.0
        within = (sample_m2 - start_m2) / max(ends_m2[triangle] - start_m2, 1e-30)
        share = math.sqrt(min(max(within, 0.0), 1.0))
        fine = np.float64(b[point]) * CURVE_CELLS
        aside = share * (fine - math.floor(fine))
        ahead_m = 0.0
        squared_m2 = 0.0
        for axis in range(3):
            first_m = corners_m[triangle, 0, axis]
            second_m = corners_m[triangle, 1, axis]
            third_m = corners_m[triangle, 2, axis]
            place_m = first_m + share * (second_m - first_m) + aside * (third_m - second_m)
            step_m = place_m - points_m[point, axis]
            vectors_m[point, axis] = step_m
            ahead_m -= step_m * normals[triangle, axis]
            squared_m2 += step_m * step_m
        squared_m2 = max(squared_m2, 1e-9)
        strength[point] = intensity_cd * max(ahead_m, 0.0) / (squared_m2 * math.sqrt(squared_m2))


@compiled
def ahead_of(points_m: Floats, normals: Floats, rows: Rows, centre_m: Floats, radius_m: float, chosen: Mask) -> None:
    """Write which of the points at rows (N,) have any of a ball before them."""
    for place in range(len(rows)):
        point = rows[place]
        ahead_m = 0.0
        for axis in range(3):
            ahead_m += (centre_m[axis] - points_m[point, axis]) * normals[point, axis]
        chosen[place] = ahead_m > -radius_m


@compiled
def meet_boxes(origins_m: Floats, segments_m: Floats, around_m: Floats, boxes_m: Floats, is_met: Mask) -> None:
    """Write which segments (R, 3) from origins meet any of the boxes (K, 2, 3), given by lower and upper corners.

    `around_m` (2, 3) is a box around all of them.
    """
    for ray in range(len(origins_m)):
        is_met[ray] = False
        if not _meets_box(origins_m[ray], segments_m[ray], around_m):
            continue
        for box in range(len(boxes_m)):
            if _meets_box(origins_m[ray], segments_m[ray], boxes_m[box]):
                is_met[ray] = True
                break


@compiled
def _meets_box(origin_m: Floats, segment_m: Floats, box_m: Floats) -> bool:
    """Whether a segment (3,) from an origin (3,) meets a box (2, 3)."""
    enters = np.float32(0)
    leaves = ONE
    for axis in range(3):
        start_m = origin_m[axis]
        step_m = segment_m[axis]
        low_m = box_m[0, axis] - start_m
        high_m = box_m[1, axis] - start_m
        if step_m == 0:
            if low_m > 0 or high_m < 0:
                return False
            continue
        first = low_m / step_m
        second = high_m / step_m
        enters = max(enters, min(first, second))
        leaves = min(leaves, max(first, second))
        if enters > leaves:
            return False
    return True
