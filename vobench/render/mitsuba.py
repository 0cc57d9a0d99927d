"""A scene in Mitsuba's terms: shapes, materials, emitters, the sun, and the libLLVM it compiles with."""

import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from vobench import stop
from vobench.errors import MissingDependencyError
from vobench.geometry.se3 import Array
from vobench.render.geometry import SurfaceList, corners, inventory
from vobench.scene.light import SUN_RADIUS_RAD, AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import Glass, Material, Matt, Mirror, Polished, Textured, reflectance, texture_of
from vobench.scene.scene import Scene
from vobench.scene.surface import Surface

VARIABLE = "DRJIT_LIBLLVM_PATH"
VARIANT = "llvm_ad_mono"
OLDEST_MAJOR = 15  # Dr.Jit refuses older ones; 15 and 16 cannot compile for some processors
FOLDERS = ("usr/lib/*-linux-gnu", "usr/lib64", "usr/lib", "usr/lib/llvm*/lib", "usr/local/lib")
LLVM_REMEDY = "apt-get update && apt-get install -y libllvm19"
MITSUBA_REMEDY = f"{sys.executable} -m pip install 'mitsuba>=3.9,<4'"
PROBE_TIMEOUT_S = 120

# Renders for real: a library that loads may still abort when the first kernel is compiled.
PROBE = f"""
import mitsuba as mi
mi.set_variant("{VARIANT}")
sphere = {{"type": "sphere", "bsdf": {{"type": "roughplastic"}}}}
sensor = {{"type": "perspective", "to_world": mi.ScalarTransform4f().translate([0, 0, -5])}}
parts = {{"sphere": sphere, "sensor": sensor, "sky": {{"type": "constant"}}, "integrator": {{"type": "path"}}}}
scene = mi.load_dict({{"type": "scene", **parts}})
mean = float(mi.TensorXf(mi.render(scene, spp=1)).array.numpy().mean())
assert 0.5 < mean < 1.5, mean
"""


@cache
def prepare() -> None:
    """Make `import mitsuba` safe in this process, and set its variant.

    Raises MissingDependencyError where Mitsuba or a libLLVM that works is missing.
    """
    os.environ[VARIABLE] = str(working_library())
    import mitsuba as mi

    mi.set_variant(VARIANT)
    mi.set_log_level(mi.LogLevel.Error)


def working_library() -> Path:
    """The first candidate that renders.

    Raises MissingDependencyError where Mitsuba is not installed, or none renders: names them and says why not.
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
    """Libraries worth trying: the one the environment names, then the system's, newest first."""
    named = os.environ.get(VARIABLE)
    if named:
        yield Path(named)
    found = {path.resolve() for folder in FOLDERS for path in Path("/").glob(f"{folder}/libLLVM*.so*")}
    ranked = sorted(found, key=lambda path: (major(path), str(path)), reverse=True)
    yield from (path for path in ranked if major(path) >= OLDEST_MAJOR and str(path) != named)


def major(library: Path) -> int:
    """The version in a library's name (libLLVM-15.so.1, libLLVM.so.19.1), 0 where it has none."""
    number = re.search(r"libLLVM(?:-(\d+)|\.so\.(\d+))", library.name)
    return int(number[1] or number[2]) if number else 0


def failure(library: Path) -> str:
    """Why Mitsuba does not render with this library, "" if it does: tried in a process with an empty kernel cache."""
    home = tempfile.mkdtemp(prefix="vobench-llvm-")
    with stop.undone(lambda: stop.remove(Path(home))):
        environment = os.environ | {VARIABLE: str(library), "HOME": home}
        command = [sys.executable, "-P", "-c", PROBE]
        try:
            done = stop.run(command, env=environment, timeout_s=PROBE_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return f"no picture after {PROBE_TIMEOUT_S} s"
    if done.returncode < 0:
        return f"killed by {signal.Signals(-done.returncode).name}"
    silent = [f"died with {done.returncode}"]
    return (done.stderr.strip().splitlines() or silent)[-1][:200] if done.returncode else ""


PLUGIN = "vobench_sun"
FAR_M = 1e4  # beyond every scene; shadow rays end here


@cache
def register() -> None:
    """Make the plugin known to Mitsuba, whose variant must be set."""
    import drjit as dr
    import mitsuba as mi

    class SunDisc(mi.Emitter):  # type: ignore[misc]
        """`irradiance` on a surface that faces `direction`, the unit vector towards the sun; itself unseen.

        Delta light to the integrator, as only emitter sampling finds it; its direction is drawn from the disc.
        """

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.irradiance = mi.Float(properties["irradiance"])
            self.direction = mi.Vector3f(properties["direction"])
            self.m_flags = mi.EmitterFlags.Infinite | mi.EmitterFlags.DeltaDirection
            dr.make_opaque(self.irradiance, self.direction)

        def traverse(self, callback: Any) -> None:
            callback.put("irradiance", self.irradiance, mi.ParamFlags.NonDifferentiable)
            callback.put("direction", self.direction, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, _keys: Any) -> None:
            # Constants would be compiled into the kernel, one kernel for each value.
            dr.make_opaque(self.irradiance, self.direction)

        def sample_direction(self, it: Any, sample: Any, active: Any = True) -> tuple[Any, Any]:
            disc = mi.warp.square_to_uniform_cone(sample, float(np.cos(SUN_RADIUS_RAD)))
            ds = dr.zeros(mi.DirectionSample3f)
            ds.d = mi.Frame3f(self.direction).to_world(disc)
            ds.dist, ds.p, ds.n = FAR_M, it.p + FAR_M * ds.d, -ds.d
            ds.uv, ds.time, ds.pdf, ds.delta = sample, it.time, 1.0, True
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

    mi.register_emitter(PLUGIN, SunDisc)


SKY_PX = (512, 1024)  # rows and columns of the sky's picture: a third of a degree; even, so that none is the horizon
BLACK = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}

Plugin = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Group:
    """Surfaces that share a mesh: one material, and one mover (-1 for what is static)."""

    mover: int
    material: str
    surfaces: tuple[int, ...]

    @property
    def key(self) -> str:
        """The mesh's name in Mitsuba's scene."""
        return f"mesh_{self.mover + 1}_{self.surfaces[0]}"


def groups(things: SurfaceList) -> list[Group]:
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
    register()
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
    texture = texture_of(scene.materials[material])
    return texture.tile_m if texture else 1.0


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
        case Matt():
            return {"type": "diffuse", "reflectance": _texture(mi, material)}
        case Polished():
            coat = {"int_ior": material.eta, "ext_ior": 1.0, "nonlinear": True}
            colours = {"specular_reflectance": _uniform(material.tint), "diffuse_reflectance": _texture(mi, material)}
            return {**_polish("plastic", material.roughness), **coat, **colours}
        case Mirror():
            kind = _polish("conductor", material.roughness)
            return {**kind, "material": "none", "specular_reflectance": _uniform(material.tint)}
        case Glass():
            passing = {"specular_transmittance": _uniform(material.tint)}
            return {"type": "thindielectric", "int_ior": material.eta, "ext_ior": 1.0, **passing}


def _polish(kind: str, roughness: float) -> Plugin:
    return {"type": f"rough{kind}", "distribution": "ggx", "alpha": roughness} if roughness else {"type": kind}


def _uniform(value: float) -> Plugin:
    return {"type": "uniform", "value": value}


def _texture(mi: Any, texture: Textured) -> Plugin:
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
            return {"type": PLUGIN, "irradiance": nominal(light), "direction": list(light.direction(0))}
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
