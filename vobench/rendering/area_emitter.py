"""Emitters with an area: rectangular panels, and lamps of any shape."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.rendering.array_types import Floats
from vobench.rendering.emitter import Aim, Emitter, sphere_width_rad
from vobench.rendering.geometry import RAY_OFFSET_M, BoundingSphere, bounding_sphere, lengths
from vobench.rendering.shadow_kernels import CURVE_BITS, aim_at_area, aim_at_triangles
from vobench.rendering.solid_angle import Rectangle, SeenRectangle, SolidAngle, rectangle
from vobench.rendering.texel import Texels
from vobench.scene.light import AreaLight
from vobench.scene.mesh import face_corners

NEAR = 2.0  # the distance, in radii of a rectangle, up to which it is sampled by solid angle, to reduce the noise
COAT_SIDE = 2  # the side of the grid of places on a panel with which the share of light that enters a coat is computed


@dataclass(frozen=True, slots=True, eq=False)
class Panel(Emitter):
    """A rectangular lamp, which shines only to its front."""

    light: AreaLight
    face: Rectangle
    ball: BoundingSphere

    def towards(self, texels: Texels) -> Aim:
        """Places that are uniform over its area. For points near it, they are uniform over its solid angle."""
        distances_m = lengths(texels.points_m - self.ball.centre_m.astype(np.float32))
        near = np.flatnonzero(distances_m < NEAR * self.ball.radius_m)
        from_afar = self._by_area(texels)
        if not len(near):
            return from_afar
        from_near = self._by_solid_angle(texels.take(near))

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, strength = from_afar(a, b)
            vectors_m[near], strength[near] = from_near(a[near], b[near])
            return vectors_m, strength

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """The width of its bounding sphere."""
        return sphere_width_rad(self.ball, points_m)

    def unshadowed_light(self, texels: Texels) -> Floats:
        """The illuminance (P,) by Lambert's formula; NaN if the horizon of a curved surface cuts the panel."""
        seen = SeenRectangle(self.face, texels.points_m)
        projected_sr = seen.projected_sr(texels.normals, texels.planes)
        arriving_lx = self.light.luminance_cd_m2 * projected_sr
        light = np.where(seen.is_before, arriving_lx, 0).astype(np.float32)
        coated = np.flatnonzero((texels.eta > 0) & (light > 0))
        light[coated] *= self._entering(texels.take(coated))
        return light

    def _entering(self, texels: Texels) -> Floats:
        """The share (P,) of its light that enters the coats of points."""
        aim = self.towards(texels)
        arriving = np.zeros(len(texels), np.float32)
        entering = np.zeros(len(texels), np.float32)
        for column, row in np.ndindex(COAT_SIDE, COAT_SIDE):
            a = np.full(len(texels), (column + 0.5) / COAT_SIDE, np.float32)
            b = np.full(len(texels), (row + 0.5) / COAT_SIDE, np.float32)
            vectors_m, strength = aim(a, b)
            cosine = texels.cosine(vectors_m)
            arriving += strength * cosine
            entering += strength * cosine * texels.entering(cosine)
        return entering / np.maximum(arriving, np.float32(1e-30))

    def _by_solid_angle(self, texels: Texels) -> Aim:
        """Places that are uniform over the solid angle of the panel."""
        seen = SeenRectangle(self.face, texels.points_m)
        angle = SolidAngle(seen)
        arriving_lx = self.light.luminance_cd_m2 * angle.steradian
        strength = np.where(seen.is_before, arriving_lx, 0).astype(np.float32)
        lift_m = (RAY_OFFSET_M * self.face.normal).astype(np.float32)
        return lambda a, b: (angle.vectors_m(a, b) + lift_m, strength)

    def _by_area(self, texels: Texels) -> Aim:
        """Places that are uniform over the area of the panel."""
        face = self.face
        area_m2 = np.linalg.norm(face.edge_u_m) * np.linalg.norm(face.edge_v_m)
        intensity_cd = float(self.light.luminance_cd_m2 * area_m2)  # along the normal
        lifted_m = face.corner_m + RAY_OFFSET_M * face.normal
        panel = (lifted_m, face.edge_u_m, face.edge_v_m, face.normal, intensity_cd)
        return _aim_by(aim_at_area, texels.points_m, panel)


@dataclass(frozen=True, slots=True, eq=False)
class MeshPanel(Emitter):
    """A lamp of any shape, whose triangles (K, 3, 3) shine only to their front.

    The triangles are sorted along a Z-order curve, so that stratified random numbers give stratified places.
    """

    light: AreaLight
    corners_m: Array
    ball: BoundingSphere

    @property
    def least_side(self) -> int:
        """8, because the light of a mesh is noisy: its triangles have different angles to a point."""
        return 8

    def towards(self, texels: Texels) -> Aim:
        """Places on triangles in proportion to their areas."""
        normals = face_normals(self.corners_m)
        lifted_m = self.corners_m + RAY_OFFSET_M * normals[:, None]
        ends_m2 = np.cumsum(areas_m2(self.corners_m))
        mesh = (lifted_m, normals, ends_m2, float(self.light.luminance_cd_m2))
        return _aim_by(aim_at_triangles, texels.points_m, mesh)

    def width_rad(self, points_m: Floats) -> Floats:
        """The width of its bounding sphere."""
        return sphere_width_rad(self.ball, points_m)


def _aim_by(kernel: Callable[..., None], points_m: Floats, emitter: Sequence[object]) -> Aim:
    """The function that aims at random places on an emitter from points (P, 3).

    The kernel chooses the places. `emitter` are its arguments that describe the emitter.
    """

    def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
        vectors_m = np.empty((len(points_m), 3), np.float32)
        strength = np.empty(len(points_m), np.float32)
        kernel(points_m, *emitter, a, b, vectors_m, strength)
        return vectors_m, strength

    return aim


def panel_emitter(light: AreaLight) -> Panel | MeshPanel:
    """The emitter of a lamp: a rectangle if its faces fill one, otherwise a mesh."""
    corners_m = face_corners(light.mesh)
    ball = bounding_sphere(corners_m)
    face = rectangle(corners_m)
    if face is not None:
        return Panel(light, face, ball)
    # The triangles are sorted along a Z-order curve (Morton).
    shares = (corners_m.mean(1) - ball.centre_m) / ball.radius_m / 2 + 0.5
    along_curve = _interleaved(np.clip(shares, 0, 1 - 1e-6))
    order = np.argsort(along_curve, kind="stable")
    return MeshPanel(light, corners_m[order], ball)


def _interleaved(shares: Floats) -> Floats:
    """Numbers (N,) in [0, 1) with the interleaved bits of the D shares (N, D) in [0, 1)."""
    rest = shares.astype(float)
    place = 1.0
    total = np.zeros(len(shares))
    for _ in range(CURVE_BITS):
        rest = 2 * rest
        bits = np.floor(rest)
        rest = rest - bits
        for bit in bits.T:
            place /= 2
            total += place * bit
    return total
