"""Reads the materials and pictures of glTF 2.0 files. Source: Khronos, glTF 2.0, sections 3.8, 3.9, appendix B."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vobench.asset.gltf_file import EXTENSIONS, GltfFile, Json, located, numbers
from vobench.errors import ModelError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.material import LUMINANCE, Map, Material, Picture

MOST_PIXELS = 1 << 26
# The largest side of a picture, and the largest number of texels of all pictures. Larger pictures are reduced.
MOST_SIDE = 4096
MOST_TEXELS = 1 << 27
# A coat or metal with this GGX alpha or more shows no reflections, so it is read as diffuse with its colour.
DIFFUSE_ALPHA = 0.4
# The opacity below which a blended material is a pane, and the opacity below which it is invisible.
PANE_OPACITY = 0.5
ABSENT_OPACITY = 0.02
CUTOFF = 0.5  # the default of glTF for masks; also used for blended materials that are cut out
GLASS_ETA = 1.5
# A blended picture is cut out if this share of it is nearly clear or nearly solid, by these opacities.
CLEAR_OPACITY = 0.1
SOLID_OPACITY = 0.9
CUT_OUT_SHARE = 0.8
DIM_CD_M2 = 3.0  # an emission with at most this sum over the channels probably lacks its strength


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A material, the set of texture coordinates that its pictures use, and their transform T_uv (2, 3) to uv."""

    name: str
    material: Material
    two_sided: bool = False
    uv_set: int = 0
    T_uv: Array = field(default_factory=lambda: np.eye(2, 3))
    notes: tuple[str, ...] = ()


# The default of glTF is white. In a room with only this material, light would accumulate and saturate all pictures.
BARE = Look(
    "default",
    Material(colour=(0.5, 0.5, 0.5)),
    notes=("surfaces without a material are read as grey and diffuse",),
)


class MaterialReader:
    """Reads the materials and pictures of a file, each of them only once.

    `reduced` has the indices of the images that were reduced to fit into memory.
    """

    def __init__(self, file: GltfFile) -> None:
        self.reduced: set[int] = set()
        self._file = file
        self._looks: dict[int | None, Look] = {}
        self._pictures: dict[tuple[int, int], Picture] = {}

    def look(self, index: int | None) -> Look:
        """The look of the material with an index; the default look of glTF for None."""
        if index not in self._looks:
            source = {} if index is None else self._file.entry("materials", index)
            name = "default" if index is None else str(source.get("name") or f"material_{index}")
            with located(f"material '{name}'"):
                self._looks[index] = self._read_look(name, source)
        return self._looks[index]

    def _read_look(self, name: str, source: Json) -> Look:
        surface = source.get("pbrMetallicRoughness", {})
        colour_texture = surface.get("baseColorTexture")
        emission_texture = source.get("emissiveTexture")
        *_, opacity = _base_colour(surface)

        roughness, metalness, notes = self._roughness_and_metalness(surface)
        emission_cd_m2 = _emission_cd_m2(source)
        material = self._material(source, roughness, metalness, emission_cd_m2)
        notes += _notes_on_emission(colour_texture, emission_texture, emission_cd_m2)
        material, notes_on_opacity = _with_opacity(material, source, opacity)

        uv_set, T_uv = _uv_of(colour_texture or emission_texture or {})
        all_notes = [f"material '{name}' {note}" for note in (*notes, *notes_on_opacity)]
        return Look(name, material, bool(source.get("doubleSided")), uv_set, T_uv, tuple(all_notes))

    def _roughness_and_metalness(self, surface: Json) -> tuple[float, float, list[str]]:
        """The roughness and metalness: their factors times the mean of their texture. A note says if there is one."""
        roughness = float(numbers(surface.get("roughnessFactor", 1.0)))
        metalness = float(numbers(surface.get("metallicFactor", 1.0)))
        picture = self._picture(surface.get("metallicRoughnessTexture"))
        if picture is None:
            return roughness, metalness, []
        _, mean_green, mean_blue = picture.values.mean((0, 1))
        mean_roughness = roughness * mean_green / 255
        mean_metalness = metalness * mean_blue / 255
        note = f"is {mean_metalness:.0%} metal and {mean_roughness:.0%} rough, the means of its texture"
        return mean_roughness, mean_metalness, [note]

    def _material(
        self,
        source: Json,
        roughness: float,
        metalness: float,
        emission_cd_m2: tuple[float, float, float],
    ) -> Material:
        """The material of a surface; a pane if most of the light passes through it."""
        surface = source.get("pbrMetallicRoughness", {})
        extensions = source.get("extensions", {})
        red, green, blue, _ = _base_colour(surface)
        channels = 3 if source.get("alphaMode", "OPAQUE") == "OPAQUE" else 4
        texture = self._picture(surface.get("baseColorTexture"), channels)
        emits = sum(emission_cd_m2) > 0
        emission_texture = self._picture(source.get("emissiveTexture")) if emits else None

        coat = _coat(extensions, roughness, metalness)
        transmission = extensions.get("KHR_materials_transmission", {}).get("transmissionFactor", 0)
        if transmission > PANE_OPACITY:
            tint = float(np.dot((red, green, blue), LUMINANCE))
            return Material("pane", eta=max(coat.eta, GLASS_ETA), tint=tint)
        return replace(
            coat,
            colour=(red, green, blue),
            texture=texture,
            emission_cd_m2=emission_cd_m2,
            emission_texture=emission_texture,
        )

    def _picture(
        self,
        texture: Json | None,
        channels: int = 3,
    ) -> Picture | None:
        """The pixels of a texture (H, W, 3), or (H, W, 4) if it has opacity and four channels are requested."""
        if not texture:
            return None
        source = self._file.entry("textures", texture["index"])
        extensions = source.get("extensions", {})
        if "source" not in source and "KHR_texture_basisu" in extensions:
            raise ModelError(EXTENSIONS["KHR_texture_basisu"])
        webp = extensions.get("EXT_texture_webp", {}).get("source")
        image = source.get("source", webp)
        key = (image, channels)
        if key not in self._pictures:
            pixels = self._pixels(image)[..., :channels]
            self._pictures[key] = Picture(np.ascontiguousarray(pixels))
        return self._pictures[key]

    def _pixels(self, index: Any) -> NDArray[np.uint8]:
        """The image with an index (H, W, 3), or (H, W, 4) if it is not opaque, reduced to fit into memory."""
        image = self._file.entry("images", index)
        texels = MOST_TEXELS / len(self._file.tree["images"])
        side = min(MOST_SIDE, 2 ** int(np.log2(texels) / 2))
        name = str(image.get("name") or image.get("uri") or index)[:60]
        with located(f"image '{name}'"):
            if "bufferView" in image:
                data: bytes | memoryview = self._file.view(image["bufferView"])
            else:
                data = self._file.resource(image["uri"])
            try:
                whole = _decoded(data)
                if max(whole.size) > side:
                    self.reduced.add(index)
                return np.asarray(whole.reduce(-(-max(whole.size) // side)))
            except Exception as error:  # decoders raise errors of many types
                advice = f"save it as PNG of {MOST_PIXELS:,} pixels at most"
                raise ModelError(f"cannot be read ({error}); {advice}") from None


def _decoded(data: bytes | memoryview) -> Image.Image:
    """The picture in RGB, or in RGBA if it is not opaque."""
    with warnings.catch_warnings(action="ignore"):
        image = Image.open(BytesIO(data), formats=("PNG", "JPEG", "WEBP"))
        if image.width * image.height > MOST_PIXELS:
            raise ValueError(f"{image.width} x {image.height} pixels")
        has_16_bits = image.mode.startswith("I")
        image8 = image.point(lambda grey: grey * (1 / 257)).convert("L") if has_16_bits else image
        return image8.convert("RGBA" if image.has_transparency_data else "RGB")


def _coat(extensions: Json, roughness: float, metalness: float) -> Material:
    """A material with the reflections of a surface and no colour; it reflects none if it is rough or unlit.

    The reflectance follows from the index of refraction. GGX alpha is the square of the roughness.
    """
    alpha = roughness**2
    is_diffuse = alpha > DIFFUSE_ALPHA or "KHR_materials_unlit" in extensions
    if is_diffuse:
        return Material()
    eta = float(extensions.get("KHR_materials_ior", {}).get("ior", GLASS_ETA))
    return Material(eta=max(eta, 1.0), roughness=float(alpha), metal=float(metalness))


def _base_colour(surface: Json) -> list[float]:
    """The red, green, blue and opacity of a surface, each in [0, 1]."""
    factor = numbers(surface.get("baseColorFactor", (1, 1, 1, 1)), 4)
    return np.clip(factor, 0, 1).tolist()  # type: ignore[no-any-return]


def _emission_cd_m2(source: Json) -> tuple[float, float, float]:
    extension = source.get("extensions", {}).get("KHR_materials_emissive_strength", {})
    strength = numbers(extension.get("emissiveStrength", 1.0))
    factor = numbers(source.get("emissiveFactor", (0, 0, 0)), 3)
    red, green, blue = np.clip(factor * strength, 0, None).tolist()
    return red, green, blue


def _notes_on_emission(
    colour_texture: Json | None,
    emission_texture: Json | None,
    emission_cd_m2: Sequence[float],
) -> list[str]:
    """Notes if an emission is weak, or if its texture is mapped differently from that of the colour."""
    red, green, blue = emission_cd_m2
    notes = []
    if 0 < red + green + blue <= DIM_CD_M2:
        brightest = max(red, green, blue)
        notes.append(f"gives {brightest:.3g} cd/m², little in a lit room; set its emissiveStrength")
    if colour_texture and emission_texture and not _is_mapped_alike(colour_texture, emission_texture):
        notes.append("has its emission mapped as its colour is")
    return notes


def _is_mapped_alike(texture: Json, other: Json) -> bool:
    """Whether two textures use the same texture coordinates and transform."""
    return {**texture, "index": 0} == {**other, "index": 0}


def _uv_of(texture: Json) -> tuple[int, Array]:
    """The set of coordinates that a texture uses, and their transform T_uv (2, 3) by KHR_texture_transform."""
    transform = texture.get("extensions", {}).get("KHR_texture_transform", {})
    rotation = se3.rotation_z(-numbers(transform.get("rotation", 0.0)))[:2, :2]
    scale = numbers(transform.get("scale", (1, 1)), 2)
    offset = numbers(transform.get("offset", (0, 0)), 2)
    T_uv = np.column_stack([rotation * scale, offset])
    uv_set = transform.get("texCoord", texture.get("texCoord", 0))
    return uv_set, T_uv


def _opacity(material: Material, factor: float) -> Map | Array:
    """The opacity (H, W) of a texture times a factor."""
    if material.texture is None:
        return np.full((1, 1), factor)
    pixels = material.texture.pixels()
    if pixels.shape[-1] != 4:
        return np.full((1, 1), factor)
    return np.asarray(pixels[..., 3] / np.float32(255) * factor)


def _with_opacity(
    material: Material,
    source: Json,
    factor: float,
) -> tuple[Material, list[str]]:
    """The material with its opacity applied, which makes holes in it or turns it into a pane, and notes on that."""
    mode = source.get("alphaMode", "OPAQUE")
    if mode == "OPAQUE" or material.kind == "pane":
        return material, []
    opacity = _opacity(material, factor)
    if mode == "MASK":
        cutoff = float(numbers(source.get("alphaCutoff", CUTOFF)))
        return _masked(material, opacity, cutoff, factor)
    return _blended(material, opacity, factor)


def _masked(
    material: Material,
    opacity: Map | Array,
    cutoff: float,
    factor: float,
) -> tuple[Material, list[str]]:
    """The material with holes where its opacity is below a cutoff."""
    if opacity.max() < cutoff:
        return _open_pane()
    if opacity.min() < cutoff:
        return replace(material, cutout=min(cutoff / factor, 1.0)), []
    return material, []


def _blended(
    material: Material,
    opacity: Map | Array,
    factor: float,
) -> tuple[Material, list[str]]:
    """The material that a blended material probably represents: an open pane, holes, glass, or an opaque material."""
    if opacity.max() < ABSENT_OPACITY:
        return _open_pane()
    is_clear_or_solid = (opacity < CLEAR_OPACITY) | (opacity > SOLID_OPACITY)
    if opacity.min() < CUTOFF and is_clear_or_solid.mean() > CUT_OUT_SHARE:
        note = "is blended: cut out where it is less than half opaque"
        return replace(material, cutout=min(CUTOFF / factor, 1.0)), [note]
    mean = opacity.mean()
    if mean < PANE_OPACITY:
        return Material("pane", eta=GLASS_ETA, tint=float(1 - mean)), [f"is {mean:.0%} opaque: a pane"]
    return material, ["is blended: read as solid"] if opacity.min() < 1 else []


def _open_pane() -> tuple[Material, list[str]]:
    return Material("pane"), ["is wholly clear: an open pane"]
