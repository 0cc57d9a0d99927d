"""Which renderer draws a scene, and the scene's light from the store."""

from pathlib import Path
from typing import Any

from vobench.pipeline.workshop import Workshop
from vobench.render.bake import BakedScene, BakeSettings, bake
from vobench.render.baked_file import load_baked, save_baked
from vobench.render.egl import require_drawing
from vobench.render.renderer import Renderer
from vobench.results.store import code_digest, library_versions
from vobench.scene.scene import Scene
from vobench.suite.rendering_spec import RenderingSpec
from vobench.suite.scene_spec import SceneFile

BAKE = BakeSettings()
# What of a scene's file its light does not depend on; levels weigh the light of each lamp later.
UNLIT: dict[str, Any] = {
    "summary": True,
    "white_cd_m2": True,
    "lamps": {"__all__": {"level"}},
    "sun": {"level"},
    "sky": {"level"},
}


def open_renderer(spec: SceneFile, scene: Scene, rendering: RenderingSpec, shop: Workshop) -> Renderer:
    """The renderer of a scene that was built from `spec`; the caller closes it.

    Raises MissingDependencyError where this machine cannot draw, before any light is computed.
    """
    # Neither OpenGL nor Mitsuba is loaded where no picture is drawn, so that cached cases need none.
    if rendering.engine == "path":
        from vobench.render.path import SAMPLES, PathRenderer

        return PathRenderer(scene, samples=rendering.samples or SAMPLES)
    from vobench.render.raster import RasterRenderer

    require_drawing()
    return RasterRenderer(_baked(spec, scene, shop))


def _baked(spec: SceneFile, scene: Scene, shop: Workshop) -> BakedScene:
    """The scene with its light, from the store where it has been computed before, under whatever levels."""
    inputs = {
        "scene": spec.model_dump(mode="json", exclude=UNLIT),
        "settings": repr(BAKE),
        "code": code_digest("geometry", "scene", "render", "suite"),
        "libraries": library_versions("numpy", "scipy", "embreex"),
    }

    def build(folder: Path) -> None:
        with shop.progress.step(f"light of {scene.name}") as tell:
            save_baked(folder, bake(scene, BAKE, tell))

    return load_baked(shop.store.get("bakes", inputs, build), scene)
