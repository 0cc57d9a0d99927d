"""A scene in Mitsuba's terms: surfaces as meshes, materials and lights as its plugins."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from vobench.geometry.se3 import Array
from vobench.render import mitsuba_sun
from vobench.render.geometry import Inventory, corners, inventory
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import Glass, Material, Matt, Mirror, Polished
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface
from vobench.scene.texture import Texture, reflectance

SKY_PX = (512, 1024)  # rows and columns of the sky's picture: a third of a degree; even, so that none is the horizon
BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}

Plugin = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Group:
    """Surfaces that share a mesh: one material, and one mover (-1 for what stands still)."""

    mover: int
    material: str
    surfaces: tuple[int, ...]

    @property
    def key(self) -> str:
        """The mesh's name in Mitsuba's scene."""
        return f"mesh_{self.mover + 1}_{self.surfaces[0]}"


def groups(things: Inventory) -> list[Group]:
    """All surfaces but the lights' panels by mover and material."""
    members: dict[tuple[int, str], list[int]] = {}
    for index, surface in enumerate(things.surfaces):
        if things.panel[index] < 0:
            members.setdefault((int(things.mover[index]), surface.material), []).append(index)
    return [Group(mover, material, tuple(indices)) for (mover, material), indices in members.items()]


def load(mi: Any, scene: Scene) -> Any:
    """Mitsuba's scene at the first instant, every light at level 1."""
    things = inventory(scene)
    bsdfs = {name: mi.load_dict(_bsdf(mi, material)) for name, material in scene.materials.items()}
    mitsuba_sun.register()
    world: Plugin = {"type": "scene"}
    for group in groups(things):
        surfaces = [things.surfaces[i] for i in group.surfaces]
        world[group.key] = _mesh(mi, group.key, surfaces, bsdfs[group.material], tile_m(scene, group.material))
    for index, light in enumerate(scene.lights):
        world[light_key(index)] = _emitter(mi, light)
    return mi.load_dict(world, optimize=False)


# Where each kind of light keeps how strong it is.
STRENGTH = {
    AreaLight: "emitter.radiance.value",
    PointLight: "intensity.value",
    SpotLight: "intensity.value",
    Sun: "irradiance",
    Sky: "scale",
}


def nominal(light: Light) -> float:
    """Strength at level 1, in the unit of its kind: cd/m², cd, lux; the sky's picture counts once."""
    match light:
        case AreaLight():
            return light.luminance_cd_m2
        case PointLight():
            return light.power_lm / (4 * np.pi)
        case SpotLight():
            return light.peak_cd
        case Sun():
            return light.illuminance_lx
        case Sky():
            return 1.0


def light_key(index: int) -> str:
    """A light's name in Mitsuba's scene."""
    return f"light_{index}"


def tile_m(scene: Scene, material: str) -> float:
    """Length of the side of a material's tile; 1 where it has none."""
    found = scene.materials[material]
    return found.texture.tile_m if isinstance(found, Matt | Polished) else 1.0


def positions(surfaces: list[Surface]) -> Array:
    """Corners (4 S, 3) of a mesh's rectangles."""
    return np.concatenate([corners(surface) for surface in surfaces])


def on_texture_m(surface: Surface) -> Array:
    """Where the four corners (4, 2) of a rectangle lie on its texture, in metres."""
    return surface.on_texture_m(np.array([0.0, 1, 1, 0]), np.array([0.0, 0, 1, 1]))


def _mesh(mi: Any, name: str, surfaces: list[Surface], bsdf: Any, tile: float) -> Any:
    """Two triangles a rectangle, with metres along its edges over the tile's size as texture coordinates."""
    properties = mi.Properties()
    properties["mesh_bsdf"] = bsdf
    mesh = mi.Mesh(name, 4 * len(surfaces), 2 * len(surfaces), props=properties, has_vertex_texcoords=True)
    parameters = mi.traverse(mesh)
    faces = 4 * np.arange(len(surfaces))[:, None] + [0, 1, 2, 0, 2, 3]
    coordinates = np.concatenate([on_texture_m(surface) for surface in surfaces]) / tile
    parameters["faces"] = faces.ravel().astype(np.uint32)
    parameters["vertex_positions"] = positions(surfaces).ravel().astype(np.float32)
    parameters["vertex_texcoords"] = coordinates.ravel().astype(np.float32)
    parameters.update()
    return mesh


def _bsdf(mi: Any, material: Material) -> Plugin:
    """The material as one of Mitsuba's plugins."""
    match material:
        case Matt(texture):
            return {"type": "diffuse", "reflectance": _texture(mi, texture)}
        case Polished():
            return _polished(mi, material)
        case Mirror(tint, roughness):
            kind = {"type": "roughconductor", **_facets(roughness)} if roughness else {"type": "conductor"}
            return {**kind, "material": "none", "specular_reflectance": _uniform(tint)}
        case Glass(eta, tint):
            return {"type": "thindielectric", **_boundary(eta), "specular_transmittance": _uniform(tint)}


def _polished(mi: Any, material: Polished) -> Plugin:
    roughness = material.roughness
    kind = {"type": "roughplastic", **_facets(roughness)} if roughness else {"type": "plastic"}
    coat = {**_boundary(material.eta), "nonlinear": True, "specular_reflectance": _uniform(material.tint)}
    return {**kind, **coat, "diffuse_reflectance": _texture(mi, material.texture)}


def _facets(roughness: float) -> Plugin:
    return {"distribution": "ggx", "alpha": roughness}


def _boundary(eta: float) -> Plugin:
    return {"int_ior": eta, "ext_ior": 1.0}


def _uniform(value: float) -> Plugin:
    return {"type": "uniform", "value": value}


def _texture(mi: Any, texture: Texture) -> Plugin:
    """The tile as it is: linear reflectance, repeated, linear between texels, row 0 at v = 0."""
    tile = mi.Bitmap(np.ascontiguousarray(reflectance(texture)[..., None]))
    return {"type": "bitmap", "bitmap": tile, "raw": True, "wrap_mode": "repeat", "filter_type": "bilinear"}


def _emitter(mi: Any, light: Light) -> Plugin:
    """The light at level 1, in cd/m², cd or lux."""
    match light:
        case AreaLight():
            panel = {"to_world": mi.ScalarTransform4f(_unit_square(light.surface)), "bsdf": BLACK}
            glow = {"type": "area", "radiance": _uniform(light.luminance_cd_m2)}
            return {"type": "rectangle", **panel, "emitter": glow}
        case PointLight():
            return {"type": "point", "position": list(light.position_m), "intensity": _uniform(nominal(light))}
        case SpotLight():
            aim = {"origin": list(light.position_m), "target": list(light.position_m + light.direction)}
            up = np.eye(3)[np.argmin(np.abs(light.direction))]
            beam = {"cutoff_angle": light.outer_deg, "beam_width": min(light.inner_deg, light.outer_deg - 1e-3)}
            pose = mi.ScalarTransform4f().look_at(**aim, up=list(up))
            return {"type": "spot", "to_world": pose, **beam, "intensity": _uniform(nominal(light))}
        case Sun():
            return {"type": mitsuba_sun.PLUGIN, "irradiance": nominal(light), "direction": list(light.direction(0))}
        case Sky():
            upright = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
            return {"type": "envmap", "bitmap": mi.Bitmap(_sky_picture(light)), "to_world": upright}


def _unit_square(surface: Surface) -> Array:
    """What takes Mitsuba's rectangle, two wide around the origin and facing z, to a surface (4, 4)."""
    M = np.eye(4)
    M[:3, 0], M[:3, 1] = surface.edge_u_m / 2, surface.edge_v_m / 2
    M[:3, 2], M[:3, 3] = surface.normal, surface.at(np.array(0.5), np.array(0.5))
    return M


def _sky_picture(sky: Sky) -> Array:
    """Luminance (rows, columns, 1) float32 as Mitsuba's environment map wants it: y up, from zenith to nadir."""
    rows, columns = SKY_PX
    theta = np.pi * np.arange(rows)[:, None] / (rows - 1)
    phi = 2 * np.pi * (np.arange(columns) + 0.5) / columns
    # Turned upright, the map's (x, y, z) are our (x, z, -y).
    directions = np.stack(
        np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi), np.cos(theta)), -1
    )
    return sky.luminance_cd_m2(directions)[..., None].astype(np.float32)
