"""Compiled kernels of the rays that gather indirect light: they make rays and evaluate where these ended."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled

# Steps of an additive recurrence that fills the unit square evenly: Roberts (2018), R2.
JITTER = np.array([0.7548776662, 0.5698402910], np.float32)
STEP_U = np.float32(JITTER[0])
STEP_V = np.float32(JITTER[1])
FULL_TURN = np.float32(2 * np.pi)
ONE = np.float32(1)
UPRIGHT = np.float32(0.9)  # vertical part of a normal from which on it is no good partner of the vertical axis
FAINT = np.float32(1e-3)  # what a mirror returns of a ray is dropped below this
# A mirrored ray with less weight than this goes on with a chance of its share of it, and then with this weight.
ROULETTE = np.float32(0.1)
ROULETTE_CYCLE = 1 << 12  # rays after which these numbers repeat: float32 resolves them
ROULETTE_STEP = np.float32(0.6180339887)  # of the numbers that decide it: the golden ratio's, which fill [0, 1) evenly
NEAR_M = np.float32(1.0)  # light from nearer changes between a surfel and its neighbours
LIFT_M = np.float32(1e-4)  # by which a mirrored ray starts off its face

# What a ray must know of a face: its unit normal, the places of its corners on the light map, the other side of its
# sheet (-1 for none), and what it does with light, as in `Response`.
FACE = np.dtype(
    [
        ("normal", np.float32, 3),
        ("light_px", np.float32, (3, 2)),
        ("twin", np.int32),
        ("lamp", np.int32),
        ("eta", np.float32),
        ("tint", np.float32),
        ("metal", np.float32),
        ("roughness", np.float32),
        ("scatters", np.bool_),
        ("shows_lamps", np.bool_),
    ]
)
Faces = NDArray[Any]  # of FACE


@compiled
def fresnel_of(cosine: float, eta: float) -> float:
    """Fresnel's reflectance at a cosine in [0, 1], from air onto eta. Source: Born and Wolf, section 1.5."""
    inside = math.sqrt(1 - (1 - cosine * cosine) / (eta * eta))
    across = (cosine - eta * inside) / (cosine + eta * inside)
    along = (inside - eta * cosine) / (inside + eta * cosine)
    return 0.5 * (across * across + along * along)


@compiled
def tangents_of(x: float, y: float, z: float) -> tuple[float, float, float, float, float, float]:
    """Two unit vectors at right angles to a unit normal and to each other."""
    if abs(z) >= UPRIGHT:
        length = math.sqrt(y * y + z * z)
        u_x = z * 0
        u_y = -z / length
        u_z = y / length
    else:
        length = math.sqrt(x * x + y * y)
        u_x = -y / length
        u_y = x / length
        u_z = z * 0
    v_x = y * u_z - z * u_y
    v_y = z * u_x - x * u_z
    v_z = x * u_y - y * u_x
    return u_x, u_y, u_z, v_x, v_y, v_z


@compiled
def cosine_rays(
    points_m: Floats,
    normals: Floats,
    planes: Floats,
    eta: Floats,
    dither: Floats,
    side: int,
    origins_m: Floats,
    directions: Floats,
    weight: Floats,
) -> None:
    """Write side x side cosine-weighted rays from each point (P, 3), point by point.

    Their weights average to what enters the coat of the point.
    """
    ray = 0
    for point in range(len(points_m)):
        x = normals[point, 0]
        y = normals[point, 1]
        z = normals[point, 2]
        u_x, u_y, u_z, v_x, v_y, v_z = tangents_of(x, y, z)
        for cell in range(side * side):
            jitter_u = dither[point, 0] + np.float32(cell) * STEP_U
            jitter_v = dither[point, 1] + np.float32(cell) * STEP_V
            a = (np.float32(cell % side) + jitter_u - np.float32(math.floor(jitter_u))) / np.float32(side)
            b = (np.float32(cell // side) + jitter_v - np.float32(math.floor(jitter_v))) / np.float32(side)
            radius = math.sqrt(a)
            angle = FULL_TURN * b
            along_u = radius * math.cos(angle)
            along_v = radius * math.sin(angle)
            cosine = math.sqrt(max(ONE - a, np.float32(1e-7)))
            direction_x = along_u * u_x + along_v * v_x + cosine * x
            direction_y = along_u * u_y + along_v * v_y + cosine * y
            direction_z = along_u * u_z + along_v * v_z + cosine * z
            origins_m[ray, 0] = points_m[point, 0]
            origins_m[ray, 1] = points_m[point, 1]
            origins_m[ray, 2] = points_m[point, 2]
            directions[ray, 0] = direction_x
            directions[ray, 1] = direction_y
            directions[ray, 2] = direction_z
            above = direction_x * planes[point, 0] + direction_y * planes[point, 1] + direction_z * planes[point, 2]
            entering = ONE
            if eta[point] > 0:
                entering = np.float32(1 - fresnel_of(cosine, eta[point]))
            weight[ray] = entering if above > 0 else np.float32(0)
            ray += 1


@compiled
def face_towards(faces: Faces, face: int, x: float, y: float, z: float) -> tuple[int, bool]:
    """The side of a sheet that a ray along (x, y, z) comes from, of the face that it met; whether it is the other."""
    twin = faces[face].twin
    if twin < 0:
        return face, False
    normal = faces[face].normal
    if normal[0] * x + normal[1] * y + normal[2] * z > 0:
        return twin, True
    return face, False


@compiled
def end_rays(
    origins_m: Floats,
    directions: Floats,
    weight: Floats,
    is_direct: Mask,
    point: Indices,
    hit_face: Indices,
    hit_u: Floats,
    hit_v: Floats,
    hit_m: Floats,
    faces: Faces,
    surfel_of: Indices,
    map_size: tuple[int, int],
    lamp_column: int,
    dither: Floats,
    is_first: bool,
    found_point: Indices,
    found_column: Indices,
    found_texel: Indices,
    found_share: Floats,
    found_near: Mask,
    onward_point: Indices,
    onward_origins_m: Floats,
    onward_directions: Floats,
    onward_weight: Floats,
    onward_direct: Mask,
    gone: Rows,
) -> tuple[int, int, int]:
    """Evaluate where rays (R, 3) ended: what each found, and which go on from a mirror. How many of each, and gone.

    A ray that ends at a lamp counts in column lamp_column + its light; none do where lamp_column is negative.
    """
    height, width = map_size
    found = 0
    onward = 0
    left = 0
    for ray in range(len(weight)):
        if hit_face[ray] < 0:
            gone[left] = ray
            left += 1
            continue
        x = directions[ray, 0]
        y = directions[ray, 1]
        z = directions[ray, 2]
        face, is_turned = face_towards(faces, hit_face[ray], x, y, z)
        row = faces[face]
        normal = row.normal
        along_normal = normal[0] * x + normal[1] * y + normal[2] * z
        if along_normal >= 0:
            continue
        cosine = min(-along_normal, ONE)
        coat = np.float32(0)
        if row.eta > 0:
            coat = np.float32(fresnel_of(cosine, row.eta))

        # What the ray finds there.
        u = hit_u[ray]
        v = ONE - hit_u[ray] - hit_v[ray] if is_turned else hit_v[ray]
        px = row.light_px
        place_x = px[0, 0] + u * (px[1, 0] - px[0, 0]) + v * (px[2, 0] - px[0, 0])
        place_y = px[0, 1] + u * (px[1, 1] - px[0, 1]) + v * (px[2, 1] - px[0, 1])
        map_column = min(max(math.floor(place_x), 0), width - 1)
        map_row = min(max(math.floor(place_y), 0), height - 1)
        texel = map_row * width + map_column
        share = np.float32(0)
        column = np.int32(-1)
        if row.lamp >= 0:
            if not is_direct[ray] and lamp_column >= 0:
                column = np.int32(lamp_column + row.lamp)
                share = weight[ray]
        elif row.scatters:
            column = surfel_of[texel]
            share = weight[ray] * (ONE - coat)
        if column >= 0 and share > 0:
            found_point[found] = point[ray]
            found_column[found] = column
            found_texel[found] = texel
            found_share[found] = share
            found_near[found] = hit_m[ray] < NEAR_M
            found += 1

        # The ray that the face mirrors.
        mirrored = weight[ray] * (row.tint * coat + (ONE - coat) * row.metal)
        if mirrored <= FAINT:
            continue
        if mirrored < ROULETTE:
            if not goes_on(mirrored, dither[point[ray]], ray):
                continue
            mirrored = ROULETTE
        facet_x = float(normal[0])
        facet_y = float(normal[1])
        facet_z = float(normal[2])
        if row.roughness > 0:
            facet_x, facet_y, facet_z = facet_of(normal, row.roughness, dither[point[ray]], ray)
        along_facet = facet_x * x + facet_y * y + facet_z * z
        mirrored_x = x - 2 * along_facet * facet_x
        mirrored_y = y - 2 * along_facet * facet_y
        mirrored_z = z - 2 * along_facet * facet_z
        # A facet may reflect a ray into its own surface.
        if mirrored_x * normal[0] + mirrored_y * normal[1] + mirrored_z * normal[2] <= 0:
            continue
        onward_point[onward] = point[ray]
        onward_origins_m[onward, 0] = origins_m[ray, 0] + hit_m[ray] * x + LIFT_M * normal[0]
        onward_origins_m[onward, 1] = origins_m[ray, 1] + hit_m[ray] * y + LIFT_M * normal[1]
        onward_origins_m[onward, 2] = origins_m[ray, 2] + hit_m[ray] * z + LIFT_M * normal[2]
        onward_directions[onward, 0] = mirrored_x
        onward_directions[onward, 1] = mirrored_y
        onward_directions[onward, 2] = mirrored_z
        onward_weight[onward] = mirrored
        onward_direct[onward] = row.shows_lamps and is_first
        onward += 1
    return found, onward, left


@compiled
def goes_on(weight: float, dither: Floats, ray: int) -> bool:
    """Whether a ray of less weight than ROULETTE is the one that stands for those like it."""
    number = dither[0] + dither[1] + np.float32(ray % ROULETTE_CYCLE) * ROULETTE_STEP
    return bool(number - math.floor(number) < weight / ROULETTE)


@compiled
def facet_of(normal: Floats, roughness: float, dither: Floats, turn: int) -> tuple[float, float, float]:
    """The unit normal of a facet around a face's, by GGX. Source: Walter et al. (2007), eqs 35 and 36."""
    jitter_a = dither[0] + turn * STEP_U
    jitter_b = dither[1] + turn * STEP_V
    a = jitter_a - math.floor(jitter_a)
    b = jitter_b - math.floor(jitter_b)
    slope = roughness * math.sqrt(a / max(1 - a, 1e-6))
    u_x, u_y, u_z, v_x, v_y, v_z = tangents_of(normal[0], normal[1], normal[2])
    along_u = slope * math.cos(2 * math.pi * b)
    along_v = slope * math.sin(2 * math.pi * b)
    x = normal[0] + along_u * u_x + along_v * v_x
    y = normal[1] + along_u * u_y + along_v * v_y
    z = normal[2] + along_u * u_z + along_v * v_z
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@compiled
def facet_normals(normals: Floats, roughness: Floats, dither: Floats) -> None:
    """Replace the normals (R, 3) of rough faces by those of random facets."""
    for ray in range(len(normals)):
        if roughness[ray] > 0:
            x, y, z = facet_of(normals[ray], roughness[ray], dither[ray], ray)
            normals[ray, 0] = x
            normals[ray, 1] = y
            normals[ray, 2] = z


@compiled
def chosen_rays(weight: Floats, point: Indices, dither: Floats, selected: Rows) -> int:
    """Write the rays (R,) that go on by their weights, those of less than ROULETTE as in `end_rays`. How many.

    The weights of these are raised.
    """
    count = 0
    for ray in range(len(weight)):
        if weight[ray] <= FAINT:
            continue
        if weight[ray] < ROULETTE:
            if not goes_on(weight[ray], dither[point[ray]], ray):
                continue
            weight[ray] = ROULETTE
        selected[count] = ray
        count += 1
    return count


@compiled
def sorted_by_point(
    point: Indices,
    column: Indices,
    share: Floats,
    selected: Mask,
    starts: Indices,
    columns: Indices,
    shares: Floats,
) -> None:
    """Write the selected entries (N,) point by point, as a CSR table whose rows begin at `starts` (P + 1,)."""
    starts[:] = 0
    for entry in range(len(point)):
        if selected[entry]:
            starts[point[entry] + 1] += 1
    for row in range(len(starts) - 1):
        starts[row + 1] += starts[row]
    following = starts.copy()
    for entry in range(len(point)):
        if selected[entry]:
            place = following[point[entry]]
            following[point[entry]] += 1
            columns[place] = column[entry]
            shares[place] = share[entry]
