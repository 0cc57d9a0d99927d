"""Blender's side of blender.py: run by a Python that has bpy, in a process of its own.

    python blender_draw.py JOB.npz PICTURES.npz

bpy is GPL; nothing of vobench is imported here, and vobench never imports this.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

MAX_BOUNCES = 32


def emissive(material: Any, luminance: float) -> None:
    """Shine from the front only; Cycles' own emission has two sides."""
    nodes = material.node_tree.nodes
    links = material.node_tree.links
    emission = nodes.new("ShaderNodeEmission")
    geometry = nodes.new("ShaderNodeNewGeometry")
    front = nodes.new("ShaderNodeMath")
    front.operation = "MULTIPLY_ADD"  # luminance x (1 - is it the back)
    front.inputs[1].default_value = -luminance
    front.inputs[2].default_value = luminance
    links.new(geometry.outputs["Backfacing"], front.inputs[0])
    links.new(front.outputs[0], emission.inputs["Strength"])
    links.new(emission.outputs[0], nodes["Material Output"].inputs["Surface"])


def matt(material: Any, tile: Any) -> None:
    """Diffuse reflectance from a tile of linear values, repeated."""
    nodes = material.node_tree.nodes
    links = material.node_tree.links
    image = bpy.data.images.new(material.name, tile.shape[1], tile.shape[0], float_buffer=True, is_data=True)
    rgba = np.ones((*tile.shape[:2], 4), np.float32)
    rgba[..., :3] = tile.reshape(*tile.shape[:2], -1)
    image.pixels.foreach_set(rgba.ravel())
    image.update()
    texture = nodes.new("ShaderNodeTexImage")
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    texture.image = image
    texture.extension = "REPEAT"
    texture.interpolation = "Linear"
    links.new(texture.outputs["Color"], diffuse.inputs["Color"])
    links.new(diffuse.outputs[0], nodes["Material Output"].inputs["Surface"])


def mesh(name: str, corners: Any, uv: Any, material: Any) -> None:
    """Triangles (F, 3, 3) with texture coordinates (F, 3, 2)."""
    made = bpy.data.meshes.new(name)
    made.from_pydata(corners.reshape(-1, 3).tolist(), [], np.arange(3 * len(corners)).reshape(-1, 3).tolist())
    made.uv_layers.new().data.foreach_set("uv", uv.astype(np.float32).ravel())
    made.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, made))


def build(job: Any) -> None:
    """The job's triangles, tiles, panels and camera in an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for name in job["materials"]:
        material = bpy.data.materials.new(str(name))
        if material.node_tree is None:  # before Blender 5 there is none unless asked for
            material.use_nodes = True
        if f"tile.{name}" in job:
            matt(material, job[f"tile.{name}"])
        else:
            emissive(material, float(job[f"luminance.{name}"]))
        mesh(str(name), job[f"corners.{name}"], job[f"uv.{name}"], material)


def film(job: Any) -> None:
    """The camera and picture: a box filter over each pixel, linear float, no view transform."""
    scene = bpy.context.scene
    width, height, focal_px = (float(value) for value in job["lens"])
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = "HORIZONTAL"
    camera.sensor_width = width
    camera.lens = focal_px
    camera.clip_start = 0.01
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = int(width)
    scene.render.resolution_y = int(height)
    scene.render.use_persistent_data = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.cycles.device = "CPU"
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.sample_clamp_indirect = scene.cycles.sample_clamp_direct = 0.0
    for kind in ("max_bounces", "diffuse_bounces", "glossy_bounces"):
        setattr(scene.cycles, kind, MAX_BOUNCES)


def draw(T_world_camera: Any, samples: int, seed: int, denoised: bool) -> tuple[Any, float]:
    """Luminance (H, W), and the seconds it took to trace, denoise and write it."""
    scene = bpy.context.scene
    # Blender's camera looks along -z with y up.
    scene.camera.matrix_world = (T_world_camera @ np.diag([1.0, -1.0, -1.0, 1.0])).T.tolist()
    scene.cycles.samples = samples
    scene.cycles.seed = seed
    scene.cycles.use_denoising = denoised
    if denoised:
        scene.cycles.denoiser = "OPENIMAGEDENOISE"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "picture.exr")
        started = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        spent_s = time.perf_counter() - started
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        height = image.size[1]
        width = image.size[0]
        bpy.data.images.remove(image)
    # Blender counts rows from the bottom.
    return pixels.reshape(height, width, -1)[::-1, :, :3] @ [0.2126, 0.7152, 0.0722], spent_s


def main() -> None:
    """Draw every way (samples, denoised) at every pose; the first picture warms up and does not count."""
    job = np.load(sys.argv[1])
    build(job)
    film(job)
    draw(job["poses"][0], 1, 0, denoised=True)
    pictures = []
    seconds = []
    for samples, denoised in job["ways"].tolist():
        drawn = [draw(pose, samples, index, denoised=bool(denoised)) for index, pose in enumerate(job["poses"])]
        pictures.append([picture for picture, _ in drawn])
        seconds.append([spent for _, spent in drawn])
    np.savez(sys.argv[2], pictures=np.array(pictures), seconds=np.array(seconds))


if __name__ == "__main__":
    main()
