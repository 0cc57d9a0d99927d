"""The raster engine: pyrender's scene graph and EGL context, with our shaders and framebuffers.

Stock pyrender multisamples (its depth and colour then sit off the pixel's centre) and clips to
8 bits. Here each pixel is the mean of 2 x 2 samples of linear light, read back as float.
"""

from pathlib import Path

import numpy as np

from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.render import egl
from vobench.render.bake import BakedScene
from vobench.render.geometry import RayCaster, all_surfaces, corners
from vobench.render.renderer import Depth, Radiance
from vobench.scene.scene import Surface

SHADERS = Path(__file__).parent / "shaders"
SUPERSAMPLING = 2
NEAR_M, FAR_M = 0.05, 60.0
# OpenCV's camera looks along +z with y down, OpenGL's along -z with y up.
T_CV_GL = np.diag([1.0, -1.0, -1.0, 1.0])
LAMP = ".lamp"  # the material of lamps' panels; a scene's own names have no dot in front


class RasterRenderer:
    """Pictures of a baked scene by OpenGL; exact depth by rays. One per process is enough."""

    def __init__(self, baked: BakedScene) -> None:
        self._platform = egl.context()
        # Imported late: they need the context's library to be loadable.
        import pyrender

        from vobench.render.framebuffer import LinearRenderer

        self._caster = RayCaster(baked.scene)
        self._renderer = LinearRenderer(str(SHADERS), supersampling=SUPERSAMPLING)
        self._scene = pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 1.0])
        self._scene.add(_mesh(baked))
        self._camera = self._scene.add(pyrender.IntrinsicsCamera(1.0, 1.0, 0.0, 0.0, NEAR_M, FAR_M))

    def radiance(self, camera: Pinhole, T_world_camera: Array) -> Radiance:
        """Luminance (H, W) in cd/m², linear and unclipped, averaged over each pixel's area."""
        lens = self._camera.camera
        # OpenGL counts from the corner of the top-left pixel, OpenCV from its centre.
        lens.cx, lens.cy = (SUPERSAMPLING * (c + 0.5) for c in (camera.cx_px, camera.cy_px))
        lens.fx, lens.fy = SUPERSAMPLING * camera.fx_px, SUPERSAMPLING * camera.fy_px
        self._scene.set_pose(self._camera, T_world_camera @ T_CV_GL)
        self._platform.make_current()
        return self._renderer.picture(self._scene, width=camera.width_px, height=camera.height_px)

    def depth(self, camera: Pinhole, T_world_camera: Array) -> Depth:
        """Depth (H, W) in metres along the optical axis at each pixel's centre; NaN where nothing is."""
        return self._caster.depth(camera, T_world_camera)

    def close(self) -> None:
        """Free the OpenGL context and all in it."""
        self._platform.make_current()
        self._renderer.delete()
        egl.release(self._platform)


def _mesh(baked: BakedScene) -> object:
    """One primitive per material, all lit by the one map of illuminance."""
    import pyrender

    from vobench.render.framebuffer import FloatTexture, ReflectanceTexture

    light = FloatTexture(baked.illuminance)
    by_material: dict[str, list[int]] = {}
    for index, surface in enumerate(all_surfaces(baked.scene)):
        lamp = index >= len(baked.scene.surfaces)
        by_material.setdefault(LAMP if lamp else surface.material, []).append(index)
    primitives = []
    for name, indices in sorted(by_material.items()):
        tile = np.ones((2, 2), np.float32) if name == LAMP else baked.albedo[name]
        material = pyrender.MetallicRoughnessMaterial(
            baseColorTexture=ReflectanceTexture(tile), emissiveTexture=light, doubleSided=False
        )
        tile_m = 1.0 if name == LAMP else baked.scene.textures[name].tile_m
        primitives.append(_primitive(baked, indices, tile_m=tile_m, material=material))
    return pyrender.Mesh(primitives)


def _primitive(baked: BakedScene, indices: list[int], *, tile_m: float, material: object) -> object:
    import pyrender

    surfaces = all_surfaces(baked.scene)
    quads = np.arange(len(indices))[:, None] * 4 + [0, 1, 2, 0, 2, 3]
    return pyrender.Primitive(
        positions=np.concatenate([corners(surfaces[i]) for i in indices]),
        texcoord_0=np.concatenate([_tile_coordinates(surfaces[i]) / tile_m for i in indices]),
        texcoord_1=np.concatenate([baked.layout.texture_coordinates(i) for i in indices]),
        indices=quads.reshape(-1, 3),
        material=material,
        mode=4,
    )


def _tile_coordinates(surface: Surface) -> Array:
    """Metres (4, 2) along the surface's edges at its corners."""
    width, height = surface.size_m
    return np.array([[0, 0], [width, 0], [width, height], [0, height]])
