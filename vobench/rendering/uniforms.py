"""Fills the uniform blocks that describe a view, its probe and a batch; see `uniform_block`."""

import numpy as np
from numpy.typing import NDArray

from vobench.rendering.batch import Batch
from vobench.rendering.framebuffer import LayeredFramebuffer
from vobench.rendering.gl_texture import SurfaceTexture
from vobench.rendering.probe import Probe, area_glint_share, level_of, probe_share
from vobench.rendering.rough_fresnel import SMOOTH, rough_reflectance
from vobench.rendering.uniform_block import GLINT_ROWS
from vobench.rendering.view import PinholeView
from vobench.scene.material import Rgb, emitted_cd_m2, inner_reflectance

CLIP_MARGIN_PX = 1 / 8  # the distance of the clip plane behind a mirror
Block = NDArray[np.void]  # the values of one uniform block, a structured array of shape ()


def set_view(
    uniforms: Block,
    view: PinholeView,
    framebuffer: LayeredFramebuffer,
    weights: Rgb,
) -> None:
    """Set the uniforms of a view, without those of the probe."""
    uniforms["direct"] = view.direct.T
    uniforms["eye"] = view.eye_m
    if view.mirror is not None:
        # The clip plane is slightly behind the mirror, so that no gap appears where a surface crosses the mirror.
        focal_px = min(view.camera.fx_px, view.camera.fy_px)
        # The product of `pixel_width_m` (4,) and a homogeneous point is the width of a pixel at the point's depth.
        pixel_width_m = view.view_projection[3] / focal_px
        uniforms["clip_plane"] = view.mirror.coefficients + pixel_width_m * CLIP_MARGIN_PX
    uniforms["lod_bias"][: framebuffer.layers] = framebuffer.pattern.lod_bias
    for index, plane in enumerate(view.mirrors):
        uniforms["mirrors"][index] = plane.coefficients
    uniforms["ambient"] = view.ambient_cd_m2
    uniforms["weights"] = weights
    uniforms["inverse_weight_sum"] = 1 / sum(weights)
    uniforms["airlight"] = view.airlight_cd_m2
    uniforms["extinction"] = view.extinction_per_m


def set_probe(uniforms: Block, view: PinholeView, probe: Probe) -> None:
    """Set the uniforms of the probe and of the glints."""
    uniforms["probe_centre"] = probe.centre_m
    uniforms["probe_low"] = probe.low_m
    uniforms["probe_high"] = probe.high_m
    uniforms["probe_gradient"] = probe.light[:3]
    uniforms["probe_mean"] = probe.light[3]
    uniforms["probe_scale"] = view.ambient_cd_m2 / np.maximum(probe.ambient_cd_m2, 1e-12)
    uniforms["glint_count"] = len(view.glints)
    uniforms["glints"][: GLINT_ROWS * len(view.glints)] = view.glints.reshape(-1, 4)


def set_batch(
    uniforms: np.void,
    batch: Batch,
    texture: SurfaceTexture | None,
) -> None:
    """Set the uniforms of a batch."""
    uniforms["model"] = np.eye(4)
    if batch.mirror:
        uniforms["plane"] = batch.mirror.plane.coefficients
    uniforms["cutout"] = batch.material.cutout or 0.0
    _set_colour(uniforms, batch, texture)
    _set_emission(uniforms, batch)
    _set_coat(uniforms, batch)
    _set_gloss(uniforms, batch)


def _set_colour(uniforms: np.void, batch: Batch, texture: SurfaceTexture | None) -> None:
    """Set the reflectance of a body, or the colour of a mirror or pane, and its tint."""
    material = batch.material
    texture_scale = texture.scale if texture else 1.0
    scale = texture_scale if material.kind == "body" else material.tint
    uniforms["colour"] = scale * np.array(material.colour)
    uniforms["tint"] = material.tint


def _set_emission(uniforms: np.void, batch: Batch) -> None:
    """Set the emission, and how often its texture is repeated in one tile of the material."""
    material = batch.material
    # The light map contains the mean emission of a lamp, so its texture is relative to the mean.
    mean_cd_m2 = emitted_cd_m2(material)
    relative_emission = np.divide(material.emission_cd_m2, mean_cd_m2, out=np.ones(3), where=mean_cd_m2 > 0)
    uniforms["emission"] = relative_emission if batch.is_lamp else material.emission_cd_m2
    uniforms["emission_repeats"] = 1.0
    if material.emission_texture:
        uniforms["emission_repeats"] = material.tile_m / material.emission_texture.tile_m


def _set_coat(uniforms: np.void, batch: Batch) -> None:
    """Set the constants of refraction for light that enters and leaves a body through its coat."""
    eta = batch.material.eta
    inner = inner_reflectance(eta)
    uniforms["eta"] = eta
    uniforms["inner_reflectance"] = inner
    uniforms["inverse_eta_squared"] = 1 / eta**2
    uniforms["arriving_over_entering"] = 1 / ((1 - inner) * eta**2)


def _set_gloss(uniforms: np.void, batch: Batch) -> None:
    """Set the reflectance of a surface, its roughness and the share of the probe."""
    material = batch.material
    is_smooth = bool(batch.mirror) or material.roughness < SMOOTH
    if not is_smooth:
        coat = rough_reflectance(material.eta, material.roughness)
        uniforms["normal_reflectance"] = coat.normal
        uniforms["grazing_rise"] = coat.rise
        uniforms["grazing_exponent"] = coat.exponent
    uniforms["metal"] = material.metal
    # Rougher metal reflects less at grazing incidence: Lagarde (2011).
    uniforms["metal_rise"] = 1.0 if batch.mirror else max(1 - np.sqrt(material.roughness), 0.0)

    uniforms["roughness"] = material.roughness
    uniforms["probe_level"] = level_of(material.roughness)
    uniforms["probe_share"] = probe_share(material)
    uniforms["area_glint_share"] = area_glint_share(material)
