"""The optical properties of faces: how much light they scatter and mirror."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask
from vobench.rendering.geometry import face_materials
from vobench.rendering.visibility import Visibility
from vobench.scene.material import LUMINANCE, Material, fresnel
from vobench.scene.triangles import Triangles


@dataclass(frozen=True, slots=True)
class Response:
    """The optical properties of faces. All arrays are (F + 1,); rays without a hit read the last entry.

    `scatters` is whether a face has a body.
    `eta` is the refractive index of its coat, 0 without a coat.
    `tint` scales the light that the coat mirrors. `roughness` is that of the coat or of the metal.
    `metal` is the share of light that it mirrors without a coat.
    `lamp` is the index of its lamp, -1 for none.
    `shows_lamps` is whether it shows images of lamps, which are emitters of direct light.
    """

    scatters: Mask
    eta: Floats
    tint: Floats
    metal: Floats
    roughness: Floats
    lamp: Indices
    shows_lamps: Mask

    def mirrored(self, face: Indices, cosine: Floats) -> Floats:
        """The share (R,) of light that faces mirror at a cosine of incidence (R,)."""
        by_coat = np.where(self.eta[face] > 0, self._fresnel(face, cosine), 0)
        by_metal = (1 - by_coat) * self.metal[face]
        return np.asarray(self.tint[face] * by_coat + by_metal)

    def scattered(self, face: Indices, cosine: Floats) -> Floats:
        """The share (R,) of the light scattered below the coat that leaves it at a cosine (R,); 0 without a body."""
        leaving = np.where(self.eta[face] > 0, 1 - self._fresnel(face, cosine), 1)
        return self.scatters[face] * leaving

    def _fresnel(self, face: Indices, cosine: Floats) -> Floats:
        return fresnel(cosine, np.maximum(self.eta[face], 1.0)).astype(np.float32)


def response(
    faces: Triangles,
    materials: Mapping[str, Material],
    visibility: Visibility,
) -> Response:
    """The optical properties of the faces of a table. Metal mirrors with the luminance of its colour."""
    materials_of_things = [*face_materials(faces, materials), None]  # the last one for no face
    thing = np.append(faces.thing, len(materials_of_things) - 1)
    tints = [material.tint if material and _is_body(material) else 0 for material in materials_of_things]
    roughnesses = [material.roughness if material else 0 for material in materials_of_things]
    shows_lamps = np.zeros(len(thing), bool)
    for mirror, *_ in visibility.mirrors:
        shows_lamps[mirror.faces] = True
    return Response(
        scatters=np.array([_is_body(material) for material in materials_of_things])[thing],
        eta=np.array([_coat_eta(material) for material in materials_of_things], np.float32)[thing],
        tint=np.array(tints, np.float32)[thing],
        metal=np.array([metal_reflectance(material) for material in materials_of_things], np.float32)[thing],
        roughness=np.array(roughnesses, np.float32)[thing],
        lamp=np.append(faces.lamp, -1),
        shows_lamps=shows_lamps,
    )


def _is_body(material: Material | None) -> bool:
    return material is not None and material.kind == "body"


def _coat_eta(material: Material | None) -> float:
    """The refractive index of a body's coat, 0 without one."""
    if material is None or material.kind != "body" or not material.is_coated:
        return 0
    return material.eta


def metal_reflectance(material: Material | None) -> float:
    """The luminous reflectance of a mirror, or of the bare metal of a body; 0 for other materials."""
    if material is None:
        return 0.0
    if material.kind == "mirror":
        return material.tint
    if material.kind != "body":
        return 0.0
    return material.metal * float(np.array(material.colour) @ LUMINANCE)
