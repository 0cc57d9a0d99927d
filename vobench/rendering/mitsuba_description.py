"""A scene in the terms of Mitsuba: meshes, materials and emitters."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Pixels
from vobench.rendering.back_face import back_faces
from vobench.rendering.cutout import is_opaque
from vobench.rendering.mitsuba_sun import PLUGIN, register_sun
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import Map, Material, Rgb, Texture, linear_texture
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles

SKY_PX = (512, 1024)  # rows and columns of the sky's picture: a third of a degree; even, so that none is the horizon
PANORAMA_PX = (1024, 2048)
CUTOUT_PX = 4  # a texel's edge, in pixels of the mask of its holes

Plugin = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Group:
    """Faces (K,) of one mesh: of one material and one mover (-1 for none), visible from one side or from both."""

    mover: int
    material: str
    two_sided: bool
    faces: Pixels

    @property
    def key(self) -> str:
        """The name of the mesh in the scene of Mitsuba."""
        return f"mesh_{self.mover + 1}_{self.faces[0]}"


def groups(scene: Scene, faces: Triangles) -> list[Group]:
    """All faces but those of lamps. Of two faces back to back there is one with two sides, unless they emit light."""
    back = back_faces(faces)[:-1]
    glowing = {name for name, material in scene.materials.items() if any(material.emission_cd_m2)}
    is_glowing = np.array([thing.material in glowing for thing in faces.things], bool)[faces.thing]
    is_two_sided = (back >= 0) & ~is_glowing
    is_first = back > np.arange(len(back))
    is_included = (faces.lamp < 0) & (~is_two_sided | is_first)
    starts = np.searchsorted(faces.thing, np.arange(len(faces.things) + 1))  # things are in order
    members = dict[tuple[int, str, bool], list[Pixels]]()
    for thing, (first, end) in zip(faces.things, pairwise(starts), strict=True):
        for two_sided in (False, True):
            is_member = is_included[first:end] & (is_two_sided[first:end] == two_sided)
            rows = first + np.flatnonzero(is_member)
            if len(rows):
                kind = (int(faces.mover[first]), thing.material, two_sided)
                members.setdefault(kind, []).append(rows)
    return [Group(*kind, np.concatenate(parts)) for kind, parts in members.items()]


def load(mi: Any, scene: Scene) -> Any:
    """The scene of Mitsuba at time 0, with all lights at level 1. The variant of Mitsuba must be set."""
    body_faces = triangles(scene)
    poses = [mover.path.pose(0) for mover in scene.movers]
    faces = body_faces.with_movers_at(poses)
    register_sun()
    world: Plugin = {"type": "scene"}
    bsdfs = cache(lambda name, two_sided: mi.load_dict(_bsdf(mi, scene.materials[name], two_sided=two_sided)))
    for group in groups(scene, body_faces):
        material = scene.materials[group.material]
        bsdf = bsdfs(group.material, group.two_sided)
        glow = _glow(mi, material) if any(material.emission_cd_m2) else None
        world[group.key] = _mesh(mi, group.key, faces, group.faces, bsdf=bsdf, glow=glow, tile=material.tile_m)
    black = mi.load_dict({"type": "diffuse", "reflectance": _rgb((0, 0, 0))})
    for index, light in enumerate(scene.lights):
        key = light_key(index)
        shining = np.flatnonzero(faces.lamp == index)
        if not len(shining):
            world[key] = _emitter(mi, light)
            continue
        look = lamp_look(scene, light)
        plain = {"type": "area", "radiance": _rgb(nominal(light))}
        glow = _glow(mi, look) if look else mi.load_dict(plain)
        tile = look.emission_texture.tile_m if look and look.emission_texture else 1.0
        world[key] = _mesh(mi, key, faces, shining, bsdf=black, glow=glow, tile=tile)
    return mi.load_dict(world, optimize=False)


def one_sided(mi: Any, scene: Scene, world: Any) -> Any:
    """Whether the shapes of Mitsuba's scene, by their index there, are visible from their front only."""
    import drjit as dr

    seen_from_behind = set[str]()
    for group in groups(scene, triangles(scene)):
        if group.two_sided or scene.materials[group.material].kind == "pane":
            seen_from_behind.add(group.key)
    by_number = dict[int, bool]()
    for shape in world.shapes():
        number = int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])
        by_number[number] = shape.id() not in seen_from_behind
    count = max(by_number, default=0) + 1
    return mi.Bool([by_number.get(number, False) for number in range(count)])


# The parameter of each kind of light that scales with its level.
STRENGTH = {
    AreaLight: "emitter.radiance.value",
    PointLight: "intensity.value",
    SpotLight: "intensity.value",
    Sun: "irradiance",
    Sky: "scale",
}


def nominal(light: Light) -> Array:
    """The strength (3,) of red, green and blue at level 1, in the unit of the light: cd/m², cd or lx; 1 for the sky."""
    match light:
        case AreaLight():
            strength = light.luminance_cd_m2
        case PointLight():
            strength = light.power_lm / (4 * np.pi)
        case SpotLight():
            strength = light.peak_cd
        case Sun():
            strength = light.illuminance_lx
        case Sky():
            return np.ones(3)
    return strength * np.array(light.colour)


def lamp_look(scene: Scene, light: Light) -> Material | None:
    """The material of a lamp whose light has a texture, otherwise None."""
    if not isinstance(light, AreaLight):
        return None
    material = scene.materials.get(light.material)
    return material if material and material.emission_texture else None


def light_key(index: int) -> str:
    """The name of a light in the scene of Mitsuba."""
    return f"light_{index}"


def _mesh(
    mi: Any,
    name: str,
    faces: Triangles,
    rows: Pixels,
    *,
    bsdf: Any,
    glow: Any = None,
    tile: float = 1.0,
) -> Any:
    """The faces `rows` (K,) of a table, their corners not shared."""
    properties = mi.Properties()
    properties["mesh_bsdf"] = bsdf
    if glow:
        properties["mesh_emitter"] = glow
    vertex_count = 3 * len(rows)
    mesh = mi.Mesh(
        name,
        vertex_count=vertex_count,
        face_count=len(rows),
        props=properties,
        has_vertex_normals=True,
        has_vertex_texcoords=True,
    )
    parameters = mi.traverse(mesh)
    parameters["faces"] = np.arange(vertex_count, dtype=np.uint32)
    parameters["vertex_positions"] = faces.corners_m[rows].ravel().astype(np.float32)
    parameters["vertex_normals"] = faces.normals[rows].ravel().astype(np.float32)
    parameters["vertex_texcoords"] = (faces.uv[rows] / tile).ravel().astype(np.float32)
    parameters.update()
    return mesh


def _bsdf(mi: Any, material: Material, *, two_sided: bool) -> Plugin:
    """The material as one of Mitsuba's plugins."""
    if material.kind == "pane":
        return {
            "type": "thindielectric",
            "int_ior": material.eta,
            "ext_ior": 1.0,
            "specular_transmittance": _rgb((material.tint,) * 3),
        }
    bsdf = _opaque(mi, material)
    if two_sided:
        bsdf = {"type": "twosided", "bsdf": bsdf}
    if material.cutout is None or material.texture is None:
        return bsdf
    rows, columns = (CUTOUT_PX * side for side in material.texture.pixels().shape[:2])
    v = (np.arange(rows) + 0.5) / rows
    u = (np.arange(columns) + 0.5) / columns
    places = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    is_solid = is_opaque(material, places).reshape(rows, columns)
    opacity = _bitmap(mi, is_solid.astype(np.float32), filter_type="nearest")
    return {"type": "mask", "opacity": opacity, "bsdf": bsdf}


def _opaque(mi: Any, material: Material) -> Plugin:
    """A mirror, or a body, which may be partly metal and partly diffuse or under a coat."""
    polish = {"distribution": "ggx", "alpha": material.roughness} if material.roughness else {}
    rough = "rough" if material.roughness else ""
    mirror: Plugin = {"type": f"{rough}conductor", "material": "none", **polish}
    if material.kind == "mirror":
        return {**mirror, "specular_reflectance": _rgb((material.tint,) * 3)}
    colour = _texture(mi, material.texture, material.colour)
    body: Plugin = {"type": "diffuse", "reflectance": colour}
    if material.is_coated:
        body = {
            "type": f"{rough}plastic",
            **polish,
            "int_ior": material.eta,
            "ext_ior": 1.0,
            "nonlinear": True,
            "specular_reflectance": _rgb((material.tint,) * 3),
            "diffuse_reflectance": colour,
        }
    if not material.metal:
        return body
    metal = {**mirror, "specular_reflectance": colour}
    return {"type": "blendbsdf", "weight": material.metal, "0": body, "1": metal}


def _rgb(values: Array | Rgb) -> Plugin:
    return {"type": "rgb", "value": [float(value) for value in values]}


def _texture(
    mi: Any,
    texture: Texture | None,
    colour: Rgb,
) -> Plugin:
    """A colour times a texture, linear, repeated, linear between texels, row 0 at v = 0."""
    if texture is None:
        return _rgb(colour)
    return _bitmap(mi, linear_texture(texture) * np.array(colour, np.float32))


def _bitmap(
    mi: Any,
    tile: Map,
    *,
    filter_type: str = "bilinear",
) -> Plugin:
    with_channels = np.ascontiguousarray(tile if tile.ndim == 3 else tile[..., None])
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(with_channels),
        "raw": True,
        "wrap_mode": "repeat",
        "filter_type": filter_type,
    }


def _glow(mi: Any, material: Material) -> Any:
    """The emission of a material, as an area light."""
    radiance = _texture(mi, material.emission_texture, material.emission_cd_m2)
    return mi.load_dict({"type": "area", "radiance": radiance})


def _emitter(mi: Any, light: Light) -> Plugin:
    """A light without faces at level 1, in cd or lux."""
    match light:
        case PointLight():
            return {"type": "point", "position": list(light.position_m), "intensity": _rgb(nominal(light))}
        case SpotLight():
            target_m = light.position_m + light.direction
            up = np.eye(3)[np.argmin(np.abs(light.direction))]
            pose = mi.ScalarTransform4f().look_at(origin=list(light.position_m), target=list(target_m), up=list(up))
            return {
                "type": "spot",
                "to_world": pose,
                "cutoff_angle": light.outer_deg,
                "beam_width": min(light.inner_deg, light.outer_deg - 1e-3),
                "intensity": _rgb(nominal(light)),
            }
        case Sun():
            strength = mi.ScalarColor3f(nominal(light).tolist())
            return {"type": PLUGIN, "irradiance": strength, "direction": list(light.direction(0))}
        case Sky():
            picture = mi.Bitmap(_sky_picture(light))
            upright = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
            return {"type": "envmap", "bitmap": picture, "to_world": upright}
        case AreaLight():
            raise ValueError(f"the lamp '{light.name}' has no faces")


def _sky_picture(sky: Sky) -> Map:
    """Luminance (rows, columns, 3) float32 as Mitsuba's environment map wants it: y up, from zenith to nadir."""
    rows, columns = SKY_PX if sky.panorama is None else PANORAMA_PX
    theta = np.pi * np.arange(rows)[:, None] / (rows - 1)
    phi = 2 * np.pi * (np.arange(columns) + 0.5) / columns
    # Turned upright, the map's (x, y, z) are our (x, z, -y).
    x = np.sin(theta) * np.sin(phi)
    y = np.sin(theta) * np.cos(phi)
    z = np.cos(theta)
    directions = np.stack(np.broadcast_arrays(x, y, z), -1)
    return np.asarray(sky.seen_cd_m2(directions), np.float32)
