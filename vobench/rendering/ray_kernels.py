"""Compiled kernels of the rays that gather indirect light: their directions, their reflection, and their table."""

import math

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.compiled import compiled, float32

# The steps of an additive recurrence that fills the unit square evenly. Source: Roberts (2018), R2.
STEP_U = float32(0.7548776662)
STEP_V = float32(0.5698402910)

FULL_TURN = float32(2 * np.pi)
ZERO = float32(0)
ONE = float32(1)
UPRIGHT = float32(0.9)  # the z of a unit normal from which on the x axis is used to construct its tangents

# Russian roulette of mirrored rays: weights up to FAINT end, those up to ROULETTE continue with a probability. The
# random numbers are the multiples of the golden ratio, which fill [0, 1) evenly. They repeat after ROULETTE_CYCLE rays,
# because float32 does not resolve larger multiples well.
FAINT = float32(1e-3)
ROULETTE = float32(0.1)
ROULETTE_STEP = float32(0.6180339887)
ROULETTE_CYCLE = 1 << 12


@compiled
def fresnel_of(cosine: float, eta: float) -> float:
    """The Fresnel reflectance of a dielectric in air. Source: Born and Wolf, section 1.5.

    `cosine`, in [0, 1], is that of the angle between the ray and the normal. `eta` is the refractive index.
    """
    inside = math.sqrt(1 - (1 - cosine * cosine) / (eta * eta))
    across = (cosine - eta * inside) / (cosine + eta * inside)
    along = (inside - eta * cosine) / (inside + eta * cosine)
    return 0.5 * (across * across + along * along)


@compiled
def tangents_of(x: float, y: float, z: float) -> tuple[float, float, float, float, float, float]:
    """Two unit vectors that are perpendicular to a unit normal (x, y, z) and to each other."""
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
    """Write side x side cosine-distributed rays from each point (P, 3), point by point.

    The weight of a ray is the share of its light that enters the coat of the point, whose refractive index is `eta`
    (P,), 0 without a coat. The weight is 0 if the ray starts below the plane (P, 3) of the face, to which the normal
    (P, 3) need not be perpendicular.
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
            entering = np.float32(1)
            if eta[point] > 0:
                entering = np.float32(1 - fresnel_of(cosine, eta[point]))
            weight[ray] = entering if above > 0 else np.float32(0)
            ray += 1


@compiled
def roulette_weight(weight: float, dither_u: float, dither_v: float, ray: int) -> float:
    """The weight with which a mirrored ray continues, 0 if it ends (Russian roulette).

    A weight below ROULETTE is raised to ROULETTE with the probability that preserves its mean. `dither_u` and
    `dither_v` are the random numbers of the ray's point.
    """
    if weight <= FAINT:
        return ZERO
    if weight < ROULETTE:
        number = dither_u + dither_v + np.float32(ray % ROULETTE_CYCLE) * ROULETTE_STEP
        continues = number - math.floor(number) < weight / ROULETTE
        return ROULETTE if continues else ZERO
    return weight


@compiled
def facet_of(normal: Floats, roughness: float, dither: Floats, turn: int) -> tuple[float, float, float]:
    """The unit normal of a random microfacet by GGX. Source: Walter et al. (2007), eqs 35 and 36.

    `dither` (2,) are the random numbers of the ray's point, and `turn` distinguishes its rays.
    """
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
    """Write which rays (R,) continue, and set their weights to those of `roulette_weight`.

    `point` (R,) is the point of each ray, `dither` (P, 2) are the random numbers of points.
    Returns the number of the rays that continue.
    """
    count = 0
    for ray in range(len(weight)):
        continuing_weight = roulette_weight(weight[ray], dither[point[ray], 0], dither[point[ray], 1], ray)
        if continuing_weight > 0:
            weight[ray] = continuing_weight
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
    """Write the selected entries (N,) as a CSR table with one row for each point.

    `starts` (P + 1,) is where each row begins in `columns` and `shares`.
    """
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
