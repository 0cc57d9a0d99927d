"""A scene in Mitsuba's terms: shapes, materials, emitters, the sun, and the libLLVM it compiles with."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vobench import stop
from vobench.errors import MissingDependencyError, SettingError
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Pixels
from vobench.rendering.back_face import back_faces
from vobench.rendering.cutout import is_opaque
from vobench.scene.light import SUN_RADIUS_RAD, AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import Map, Material, Rgb, Texture, linear_texture
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.temporary import temporary_folder

VARIABLE = "DRJIT_LIBLLVM_PATH"
VARIANT_VARIABLE = "VOBENCH_MITSUBA_VARIANT"
CPU_VARIANT = "llvm_ad_rgb"
GPU_VARIANT = "cuda_ad_rgb"  # needs an NVIDIA driver with OptiX, and no libLLVM
OLDEST_MAJOR = 15  # Dr.Jit refuses older ones; 15 and 16 cannot compile for some processors
FOLDERS = ("usr/lib/*-linux-gnu", "usr/lib64", "usr/lib", "usr/lib/llvm*/lib", "usr/local/lib")
LLVM_REMEDY = "apt-get update && apt-get install -y libllvm19"
MITSUBA_REMEDY = f"{sys.executable} -m pip install 'mitsuba>=3.9,<4'"
PROBE_TIMEOUT_S = 120
MOST_CHARACTERS = 200  # of a reason in a message

# Renders for real: a library that loads may still abort when the first kernel is compiled.
PROBE = f"""
import mitsuba as mi
mi.set_variant("{CPU_VARIANT}")
sphere = {{"type": "sphere", "bsdf": {{"type": "roughplastic"}}}}
sensor = {{"type": "perspective", "to_world": mi.ScalarTransform4f().translate([0, 0, -5])}}
parts = {{"sphere": sphere, "sensor": sensor, "sky": {{"type": "constant"}}, "integrator": {{"type": "path"}}}}
scene = mi.load_dict({{"type": "scene", **parts}})
mean = float(mi.TensorXf(mi.render(scene, spp=1)).array.numpy().mean())
assert 0.5 < mean < 1.5, mean
"""


@cache
def prepare() -> None:
    """Make `import mitsuba` safe in this process, and set its variant: VOBENCH_MITSUBA_VARIANT, or the processor's.

    Raises SettingError for another variant than these two; MissingDependencyError where Mitsuba, or for the processor
    a libLLVM that works, is missing.
    """
    variant = wanted_variant()
    if variant == CPU_VARIANT:
        os.environ[VARIABLE] = str(working_library())
    elif find_spec("mitsuba") is None:
        raise MissingDependencyError(f"path tracing needs Mitsuba; run: {MITSUBA_REMEDY}")
    import mitsuba as mi

    mi.set_variant(variant)
    mi.set_log_level(mi.LogLevel.Error)


def wanted_variant() -> str:
    """The variant of Mitsuba that the environment asks for; the processor's where it asks for none.

    Raises SettingError for a variant other than CPU_VARIANT and GPU_VARIANT.
    """
    variant = os.environ.get(VARIANT_VARIABLE) or CPU_VARIANT
    if variant not in (CPU_VARIANT, GPU_VARIANT):
        raise SettingError(f"{VARIANT_VARIABLE} should be {CPU_VARIANT} or {GPU_VARIANT}, got {variant!r}")
    return variant


def working_library() -> Path:
    """The first candidate that renders.

    Raises MissingDependencyError where Mitsuba is not installed, or no library renders, with the reason of each.
    """
    if find_spec("mitsuba") is None:
        raise MissingDependencyError(f"path tracing needs Mitsuba; run: {MITSUBA_REMEDY}")
    tried = {}
    for library in candidates():
        tried[library.name] = failure(library)
        if not tried[library.name]:
            return library
    reasons = "; ".join(f"{name}: {reason}" for name, reason in tried.items()) or "none found"
    raise MissingDependencyError(f"path tracing needs a libLLVM that works here ({reasons}); run: {LLVM_REMEDY}")


def candidates() -> Iterator[Path]:
    """The libraries to try: the one that the environment names, then those of the system, newest first."""
    named = os.environ.get(VARIABLE)
    if named:
        yield Path(named)
    libraries = set[Path]()
    for folder in FOLDERS:
        libraries.update(path.resolve() for path in Path("/").glob(f"{folder}/libLLVM*.so*"))
    for library in sorted(libraries, key=lambda path: (major(path), str(path)), reverse=True):
        if major(library) >= OLDEST_MAJOR and str(library) != named:
            yield library


def major(library: Path) -> int:
    """The version in a library's name (libLLVM-15.so.1, libLLVM.so.19.1), 0 where it has none."""
    number = re.search(r"libLLVM(?:-(\d+)|\.so\.(\d+))", library.name)
    return int(number[1] or number[2]) if number else 0


def failure(library: Path) -> str:
    """Why Mitsuba does not render with this library, "" if it does: tried in a process with an empty kernel cache."""
    with temporary_folder() as home:
        environment = os.environ | {VARIABLE: str(library), "HOME": str(home)}
        command = [sys.executable, "-P", "-c", PROBE]
        try:
            done = stop.run(command, env=environment, timeout_s=PROBE_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return f"no picture after {PROBE_TIMEOUT_S} s"
    if done.returncode < 0:
        return f"killed by {signal.Signals(-done.returncode).name}"
    if done.returncode == 0:
        return ""
    lines = done.stderr.strip().splitlines()
    reason = lines[-1] if lines else f"died with {done.returncode}"
    return reason[:MOST_CHARACTERS]


PLUGIN = "vobench_sun"
FAR_M = 1e4  # beyond every scene; shadow rays end here


@cache
def register() -> None:
    """Make the plugin known to Mitsuba, whose variant must be set."""
    import drjit as dr
    import mitsuba as mi

    class SunPlugin(mi.Emitter):  # type: ignore[misc]
        """`irradiance` on a surface that faces `direction`, the unit vector towards the sun; itself unseen.

        Delta light to the integrator, as only emitter sampling finds it; its direction is drawn from the disc.
        """

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.irradiance = mi.Color3f(properties["irradiance"])
            self.direction = mi.Vector3f(properties["direction"])
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.DeltaDirection
            dr.make_opaque(self.irradiance, self.direction)

        def traverse(self, callback: Any) -> None:
            callback.put("irradiance", self.irradiance, mi.ParamFlags.NonDifferentiable)
            callback.put("direction", self.direction, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, _keys: Any) -> None:
            # Constants would be compiled into the kernel, one kernel for each value.
            dr.make_opaque(self.irradiance, self.direction)

        def sample_direction(
            self,
            it: Any,
            sample: Any,
            active: Any = True,
        ) -> tuple[Any, Any]:
            disc = mi.warp.square_to_uniform_cone(sample, float(np.cos(SUN_RADIUS_RAD)))
            ds = dr.zeros(mi.DirectionSample3f)
            ds.d = mi.Frame3f(self.direction).to_world(disc)
            ds.dist = FAR_M
            ds.p = it.p + FAR_M * ds.d
            ds.n = -ds.d
            ds.uv = sample
            ds.time = it.time
            ds.pdf = 1.0
            ds.delta = True
            ds.emitter = mi.EmitterPtr(self)
            return ds, mi.Spectrum(self.irradiance) & active

        def pdf_direction(self, *_: Any) -> Any:
            return mi.Float(0.0)

        def eval(self, *_: Any) -> Any:
            return mi.Spectrum(0.0)

        def eval_direction(self, *_: Any) -> Any:
            return mi.Spectrum(0.0)

        def bbox(self) -> Any:
            return mi.ScalarBoundingBox3f()

    mi.register_emitter(PLUGIN, SunPlugin)


SKY_PX = (512, 1024)  # rows and columns of the sky's picture: a third of a degree; even, so that none is the horizon
PANORAMA_PX = (1024, 2048)
CUTOUT_PX = 4  # a texel's edge, in pixels of the mask of its holes

Plugin = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Group:
    """Faces (K,) that share a mesh: one material, one mover (-1 for what is static), seen from one side or both."""

    mover: int
    material: str
    two_sided: bool
    faces: Pixels

    @property
    def key(self) -> str:
        """The mesh's name in Mitsuba's scene."""
        return f"mesh_{self.mover + 1}_{self.faces[0]}"


def groups(scene: Scene, faces: Triangles) -> list[Group]:
    """All faces but the lamps'; of two back to back one that has both sides, unless they glow."""
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
    """Mitsuba's scene at the first instant, every light at level 1."""
    body_faces = triangles(scene)
    poses = [mover.path.pose(0) for mover in scene.movers]
    faces = body_faces.with_movers_at(poses)
    register()
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
    """Whether the shapes of Mitsuba's scene, by their number there, are not to be seen from behind."""
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


# Where each kind of light keeps how strong it is.
STRENGTH = {
    AreaLight: "emitter.radiance.value",
    PointLight: "intensity.value",
    SpotLight: "intensity.value",
    Sun: "irradiance",
    Sky: "scale",
}


def nominal(light: Light) -> Array:
    """Strength (3,) at level 1 of red, green and blue, in the unit of its kind: cd/m², cd, lux; 1 for the sky."""
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
    """The material of a lamp that shows a picture."""
    if not isinstance(light, AreaLight):
        return None
    material = scene.materials.get(light.material)
    return material if material and material.emission_texture else None


def light_key(index: int) -> str:
    """A light's name in Mitsuba's scene."""
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
