"""Points, surfels and a gatherer of rays of a few things, as a bake makes them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.rendering.array_types import Indices
from vobench.rendering.face_response import response
from vobench.rendering.indirect_light import Gatherer
from vobench.rendering.surfel import Surfels, surfels
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sky
from vobench.scene.material import Material
from vobench.scene.triangles import Thing, triangle_table

MATERIALS = {
    "grey": Material(colour=(0.5, 0.5, 0.5)),
    "mirror": Material("mirror", tint=0.8),
    "glass": Material("pane", eta=1.5),
}


@dataclass(frozen=True, slots=True)
class GatheredRoom:
    """thing (P,): the index of the thing that each point is on."""

    points: Texels
    layout: TexelLayout
    groups: Surfels
    thing: Indices
    visibility: Visibility
    gatherer: Gatherer

    @property
    def middles(self) -> Texels:
        return self.points.take(self.groups.middle)

    @property
    def thing_of_surfel(self) -> Indices:
        return self.thing[self.groups.middle]


def gathered_room(things: Sequence[Thing], *, spacing_m: float, step_m: float, skies: Sequence[Sky] = ()):
    faces = triangle_table(list(things), [-1] * len(things), [-1] * len(things))
    is_body = np.array([MATERIALS[thing.material].kind == "body" for thing in faces.things])[faces.thing]
    atlas = unwrap(faces, np.full(len(faces), spacing_m), is_body)
    visibility = Visibility(faces, MATERIALS, np.arange(len(faces)))
    owner = owners(atlas)
    points, layout = texels(faces, MATERIALS, atlas, owner, among=is_body, seed=0, visibility=visibility)
    thing = faces.thing[points.face]
    groups = surfels(points, thing, np.full(len(points), step_m, np.float32), visibility)
    surfel_of = np.append(groups.of, np.int32(-1))[layout.source]
    optics = response(faces, MATERIALS, visibility)
    gatherer = Gatherer(atlas, visibility, optics, list(skies), surfel_of, surfels=len(groups), lamps=0)
    return GatheredRoom(points, layout, groups, thing, visibility, gatherer)
