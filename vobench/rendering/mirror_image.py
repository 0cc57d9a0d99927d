"""The images of lamps and of the sun in flat mirrors. They are emitters, too."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.emitter import Aim, Emitter, Occluder
from vobench.rendering.geometry import RAY_OFFSET_M, BoundingSphere, RayCaster, bounding_sphere
from vobench.rendering.light_emitter import emitters
from vobench.rendering.planar_patch import PlanarPatch
from vobench.rendering.texel import Texels
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Light, Sky


@dataclass(frozen=True, slots=True, eq=False)
class MirrorImage(Emitter):
    """The image of an emitter behind a mirror. Shadow rays lead straight to the image, through the faces of the mirror.

    `tint` is the reflectance of the mirror.
    `caster` casts rays at the mirror alone.
    `ball` is the bounding sphere of the image.
    """

    emitter: Emitter
    mirror: PlanarPatch
    tint: float
    caster: RayCaster
    ball: BoundingSphere

    @property
    def least_side(self) -> int:
        """That of the emitter itself."""
        return self.emitter.least_side

    @property
    def is_hard(self) -> bool:
        """Whether the emitter itself is hard."""
        return self.emitter.is_hard

    def width_rad(self, points_m: Floats) -> Floats:
        """The angular width (P,) of the image."""
        return self.emitter.width_rad(self._images_m(points_m))

    def towards(self, texels: Texels) -> Aim:
        """Places on the image."""
        # The emitter as seen from the image of a texel is the reflection of its image as seen from the texel.
        aim_from_image = self.emitter.towards(self._images(texels))

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, strength = aim_from_image(a, b)
            return self._reflected(vectors_m), np.float32(self.tint) * strength

        return aim

    def unshadowed_light(self, texels: Texels) -> Floats:
        """The light (P,) of the whole image, as if the mirror were infinitely large."""
        return np.float32(self.tint) * self.emitter.unshadowed_light(self._images(texels))

    def may_reach(self, points_m: Floats) -> Mask:
        """Whether points (P, 3) are in front of the mirror, and its bounding sphere overlaps that of the image."""
        outline = bounding_sphere(self.mirror.corners_m)
        to_image_m = self.ball.centre_m - points_m.astype(float)
        height_m = self.mirror.height_m(points_m)
        depth_m = -(to_image_m @ self.mirror.normal)  # of the image below the point
        share = np.clip(height_m / np.maximum(depth_m, 1e-9), 0, 1)  # where the line to the image crosses the mirror
        crossing_m = points_m + share[:, None] * to_image_m
        aside_m = np.linalg.norm(crossing_m - outline.centre_m, axis=1)
        reach_m = outline.radius_m + share * self.ball.radius_m
        return np.asarray((height_m > 0) & (aside_m <= reach_m))

    def transmittance(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) from the emitter to the mirror, times that from the mirror to the origins."""
        share = np.zeros(len(origins_m), np.float32)
        rays = self._through_mirror(origins_m, segments_m)
        origins_m = origins_m[rays]
        segments_m = segments_m[rays]
        crossing = self._crossing(origins_m, segments_m)[:, None]
        to_mirror_m = crossing * segments_m
        share[rays] = occluder.transmittance(origins_m, to_mirror_m)

        lift_m = (RAY_OFFSET_M * self.mirror.normal).astype(np.float32)
        reflection_points_m = origins_m + to_mirror_m + lift_m
        onwards_m = self._reflected((1 - crossing) * segments_m)
        share[rays] *= self.emitter.transmittance(occluder, reflection_points_m, onwards_m)
        return share

    def _images(self, texels: Texels) -> Texels:
        """The images of texels behind the mirror."""
        return replace(
            texels,
            points_m=self._images_m(texels.points_m),
            normals=self._reflected(texels.normals),
            planes=self._reflected(texels.planes),
        )

    def _images_m(self, points_m: Floats) -> Floats:
        """The images of points (P, 3) behind the mirror."""
        height_m = self.mirror.height_m(points_m)
        images_m = points_m - 2 * height_m[:, None] * self.mirror.normal
        return images_m.astype(points_m.dtype)

    def _crossing(self, points_m: Floats, segments_m: Floats) -> Floats:
        """The share (P,) of each segment at which it crosses the plane of the mirror."""
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing: Floats = -self.mirror.height_m(points_m) / (segments_m @ self.mirror.normal)
        return crossing.astype(np.float32)

    def _through_mirror(self, points_m: Floats, segments_m: Floats) -> Rows:
        """The rows of the segments (P, 3) from points that cross the faces of the mirror from their front."""
        crossing = self._crossing(points_m, segments_m)
        leads_down = segments_m @ self.mirror.normal < 0
        rays = np.flatnonzero(leads_down & (crossing > 0) & (crossing < 1))
        return rays[self.caster.stops(points_m[rays], segments_m[rays])]

    def _reflected(self, vectors: Floats) -> Floats:
        normal = self.mirror.normal
        return (vectors - 2 * (vectors @ normal)[:, None] * normal).astype(vectors.dtype)


def mirror_images(
    light: Light,
    visibility: Visibility,
    *,
    t_ns: float,
) -> list[Emitter]:
    """The images of a lamp or the sun in all smooth mirrors, at one instant.

    There are none of the sky, because the rays that gather indirect light are reflected to the sky by mirrors.
    """
    if isinstance(light, Sky):
        return []
    light_emitters = emitters(light, visibility, t_ns=t_ns)
    images = list[Emitter]()
    for mirror, tint, caster in visibility.mirrors:
        for emitter in light_emitters:
            centre_m = emitter.ball.centre_m
            image_m = centre_m - 2 * mirror.height_m(centre_m) * mirror.normal
            ball = BoundingSphere(image_m, emitter.ball.radius_m)
            images.append(MirrorImage(emitter, mirror, tint, caster, ball))
    return images
