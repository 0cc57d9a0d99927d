"""Checks of the surfaces of generated places: faces with an area and the right normals, and plausible materials."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from vobench.geometry.triangle import areas_m2, face_normals
from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays
from vobench.scene.triangles import Thing

LEAST_AREA_M2 = 1e-9  # smaller faces are degenerate
FOLD_M2 = 5e-6  # smaller faces may be reversed: those in the folds of tightly bent tubes, which are inside the tube
BRIGHTEST = 0.95  # reflectance of a body without a texture in any channel; fresh snow has 0.9


def complaints(place: GeneratedPlace) -> list[str]:
    """What is wrong with the surfaces of a place, in sentences; empty if nothing is."""
    found = [sentence for thing in place.things for sentence in _wrong_faces(thing)]
    found += [*_wrong_materials(place), *_repeated_lights(place)]
    return found


def _wrong_faces(thing: Thing) -> Iterator[str]:
    """Faces without an area, and faces that are shaded as if seen from behind."""
    mesh = as_arrays(thing.mesh)
    if not len(mesh.faces):
        yield f"{thing.name} has no faces"
        return
    face_areas_m2 = areas_m2(mesh.corners_m)
    is_degenerate = face_areas_m2 < LEAST_AREA_M2
    if is_degenerate.any():
        yield f"{thing.name} has {is_degenerate.sum()} faces without an area"
    vertex_normals = mesh.normals[mesh.faces].mean(axis=1)  # (F, 3)
    cosines = np.einsum("ij,ij->i", vertex_normals, face_normals(mesh.corners_m))
    is_reversed = cosines < 0
    is_wrong = is_reversed & (face_areas_m2 > FOLD_M2)
    if is_wrong.any():
        yield f"{thing.name} has {is_wrong.sum()} faces whose normals point to their back"


def _wrong_materials(place: GeneratedPlace) -> Iterator[str]:
    """Things whose material is not in the place, and materials that reflect more light than anything real."""
    for name in sorted({thing.material for thing in place.things}):
        material = place.materials.get(name)
        if material is None:
            yield f"there is no material {name}"
            continue
        yield from _implausible(name, material)


def _implausible(name: str, material: Material) -> Iterator[str]:
    """What is not plausible about a material."""
    colour = np.array(material.colour)
    is_bare_body = material.kind == "body" and material.texture is None and not any(material.emission_cd_m2)
    brightest = BRIGHTEST if is_bare_body else 1.0
    is_in_range = np.isfinite(colour).all() and colour.min() >= 0 and colour.max() <= brightest
    if not is_in_range:
        yield f"material {name} has the colour {colour.tolist()}, where 0 to {brightest} is right"
    if not (np.isfinite(material.emission_cd_m2).all() and min(material.emission_cd_m2) >= 0):
        yield f"material {name} emits {material.emission_cd_m2} cd/m2"


def _repeated_lights(place: GeneratedPlace) -> Iterator[str]:
    """Names that two lights share, by which a lighting cannot tell them apart."""
    counts = Counter(light.name for light in place.lights)
    for name, count in counts.items():
        if count > 1:
            yield f"{count} lights are called {name}"
