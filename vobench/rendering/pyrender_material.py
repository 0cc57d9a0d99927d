"""Materials and textures in pyrender's terms: metallic-roughness, 8 bits in sRGB."""

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import MissingDependencyError
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight
from vobench.scene.material import Material, Texture, pane_reflectance, srgb

REMEDY = (
    f"{sys.executable} -m pip uninstall -y pyrender && "
    f"{sys.executable} -m pip install --force-reinstall --no-deps 'pyrender2>=0.2.2'"
)
# pyrender draws things after solid ones only where their factor's alpha is below 1; textures it does not look at.
CUTOUT_ALPHA = 0.999
TILE_EDGES_M = 1.0


def require_pyrender() -> None:
    """Raise MissingDependencyError where the module pyrender is missing, or the stock one, which NumPy 2 breaks."""
    try:
        import pyrender

        corner = pyrender.Primitive(positions=np.eye(3), mode=pyrender.GLTF.TRIANGLES)
        _ = pyrender.Mesh([corner]).bounds
    except Exception as error:  # whatever an old release trips over first
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise MissingDependencyError(
            f"the engine pyrender cannot be used; stock pyrender seems to be installed beside pyrender2 ({reason}); "
            f"run: {REMEDY}"
        ) from error


def texture_tile_m(material: Material) -> float:
    """The texture coordinates that one repeat covers. pyrender supports one set of texture coordinates."""
    texture = material.texture or material.emission_texture
    return texture.tile_m if texture else TILE_EDGES_M


def pyrender_material(material: Material, white_cd_m2: float) -> Any:
    """A material; what it emits counts in shares of white."""
    import pyrender

    if material.kind == "pane":
        # What it mirrors straight ahead and what it swallows hides what is behind; it is seen from both sides.
        reflected = float(pane_reflectance(np.array(1.0), material.eta))
        opacity = 1 - material.tint * (1 - reflected)
        return pyrender.MetallicRoughnessMaterial(
            baseColorFactor=[1.0, 1.0, 1.0, opacity],
            metallicFactor=0.0,
            roughnessFactor=0.0,
            alphaMode="BLEND",
            doubleSided=True,
        )
    # pyrender's roughness is the root of GGX's alpha; a body without a coat has no highlight to speak of.
    has_highlight = material.kind == "mirror" or material.is_coated or material.metal > 0
    roughness = float(np.sqrt(material.roughness)) if has_highlight else 1.0
    if material.kind == "mirror":
        tint = material.tint
        return pyrender.MetallicRoughnessMaterial(
            baseColorFactor=[tint, tint, tint, 1.0], metallicFactor=1.0, roughnessFactor=roughness
        )
    texture = None
    scale = 1.0
    if material.texture:
        texture, scale = _texture(material.texture, material.cutout)
    emission = None
    if material.emission_texture:
        emission, _ = _texture(material.emission_texture, None)
    is_cut = material.cutout is not None and material.texture is not None
    colour = (scale * np.array(material.colour)).tolist()
    return pyrender.MetallicRoughnessMaterial(
        baseColorFactor=[*colour, CUTOUT_ALPHA if is_cut else 1.0],
        baseColorTexture=texture,
        metallicFactor=float(material.metal),
        roughnessFactor=roughness,
        # pyrender multiplies by the factor twice.
        emissiveFactor=np.sqrt(np.array(material.emission_cd_m2, float) / white_cd_m2),
        emissiveTexture=emission,
        alphaMode="BLEND" if is_cut else "OPAQUE",
    )


def lamp_material(
    light: AreaLight,
    look: Material | None,
) -> tuple[Any, Array, float]:
    """A lamp's faces: black, and glowing; with what they emit (3,) in cd/m² at level 1, and a repeat of their texture.

    look: the material that a lamp names, whose emission texture it shows.
    """
    import pyrender

    emitted = light.luminance_cd_m2 * np.array(light.colour, float)
    texture = None
    tile_m = TILE_EDGES_M
    if look and look.emission_texture:
        texture, _ = _texture(look.emission_texture, None)
        tile_m = look.emission_texture.tile_m
        emitted = np.array(look.emission_cd_m2, float)
    glowing = pyrender.MetallicRoughnessMaterial(
        baseColorFactor=[0.0, 0.0, 0.0, 1.0],
        metallicFactor=0.0,
        roughnessFactor=1.0,
        emissiveTexture=texture,
    )
    return glowing, emitted, tile_m


def _texture(texture: Texture, cutout: float | None) -> tuple[Any, float]:
    """A texture, and the number that its linear values are to be multiplied by."""
    import pyrender

    pixels = texture.pixels()
    scale = 1.0
    if pixels.ndim == 2:
        scale = max(1.0, float(pixels.max()))
        grey = srgb(pixels / scale)
        colours = np.stack([grey, grey, grey], -1)
    else:
        colours = pixels[..., :3]
    height, width = colours.shape[:2]
    alpha = np.full((height, width, 1), 255, np.uint8)
    has_opacity = pixels.ndim == 3 and pixels.shape[2] == 4
    if cutout is not None and has_opacity:
        is_hole = pixels[..., 3:] < 255 * cutout
        alpha = np.where(is_hole, 0, 255).astype(np.uint8)
    # Four bytes a texel: rows of three would need padding, which pyrender leaves out.
    source: NDArray[np.uint8] = np.concatenate([colours, alpha], -1)
    return pyrender.Texture(source=source, source_channels="RGBA"), scale
