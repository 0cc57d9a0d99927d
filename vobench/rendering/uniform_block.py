"""Uniform blocks of the surface shaders: each field is named once, for numpy and for GLSL."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

FLOAT_BYTES = 4
VECTOR_BYTES = 16  # what std140 aligns vectors, matrices and a block's size to
SHAPES: dict[str, tuple[int, ...]] = {"float": (), "vec3": (3,), "vec4": (4,), "mat4": (4, 4)}


@dataclass(frozen=True, slots=True)
class Field:
    """One member of a block; `count` is the length of an array of vec4, 0 for a single value."""

    glsl_type: str
    name: str
    comment: str
    count: int = 0

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of its numpy values; a matrix has its columns as rows."""
        shape = SHAPES[self.glsl_type]
        return (self.count, *shape) if self.count else shape

    @property
    def alignment(self) -> int:
        """The bytes that its offset is a multiple of (OpenGL 4.1, section 2.11.4, "Standard Uniform Block Layout")."""
        return FLOAT_BYTES if self.glsl_type == "float" else VECTOR_BYTES

    @property
    def declaration(self) -> str:
        """Its line in the GLSL block."""
        length = f"[{self.count}]" if self.count else ""
        return f"    {self.glsl_type} {self.name}{length};  // {self.comment}"


@dataclass(frozen=True)
class UniformBlock:
    """A block of the std140 layout, which shaders read by the name of its instance."""

    name: str
    instance: str
    binding: int
    fields: tuple[Field, ...]

    @cached_property
    def dtype(self) -> np.dtype[np.void]:
        """The structured type with the memory layout of the block; computed once, as each draw call asks for it."""
        placed = tuple(self._placed())
        offsets = [offset for offset, _ in placed]
        end = max(offset + _bytes(field) for offset, field in placed)
        return np.dtype(
            {
                "names": [field.name for field in self.fields],
                "formats": [(np.float32, field.shape) for field in self.fields],
                "offsets": offsets,
                "itemsize": _aligned(end, VECTOR_BYTES),
            }
        )

    @property
    def declaration(self) -> str:
        """The block in GLSL."""
        opening = f"layout(std140, binding = {self.binding}) uniform {self.name} {{"
        members = [field.declaration for field in self.fields]
        return "\n".join([opening, *members, f"}} {self.instance};"])

    def _placed(self) -> Iterator[tuple[int, Field]]:
        """Each field with its offset in bytes."""
        end = 0
        for field in self.fields:
            offset = _aligned(end, field.alignment)
            yield offset, field
            end = offset + _bytes(field)


def _aligned(offset: int, alignment: int) -> int:
    """The least multiple of an alignment that is no less than an offset."""
    return -(-offset // alignment) * alignment


def _bytes(field: Field) -> int:
    return FLOAT_BYTES * int(np.prod(field.shape, dtype=int))


MIRROR_PLANES = 3
MOST_GLINTS = 12
GLINT_ROWS = 4  # vectors of each

PASS = UniformBlock(
    "Pass",
    "view",
    0,
    (
        Field("mat4", "direct", "from the world to the screen as if there were no mirrors"),
        Field("vec3", "eye", "where the image is seen from"),
        Field("vec4", "clip_plane", "what lies behind it is not drawn"),
        Field("vec4", "lod_bias", "of each layer"),
        Field("vec4", "mirrors", "planes, the one seen first to begin with; 0 for none", count=MIRROR_PLANES),
        Field("vec3", "ambient", "what is mirrored where no mirror is followed"),
        Field("vec3", "weights", "of the channels in an image that has one"),
        Field("float", "inverse_weight_sum", "1 / the sum of the weights"),
        Field("vec3", "airlight", "luminance of endless fog"),
        Field("float", "extinction", "of fog, per metre"),
        Field("vec3", "probe_centre", "where the probe was drawn from"),
        Field("vec3", "probe_low", "lower bounds of the room that it shows"),
        Field("vec3", "probe_high", "upper bounds of that room"),
        Field("vec3", "probe_gradient", "how irradiance / pi at the probe rises towards a direction"),
        Field("float", "probe_mean", "irradiance / pi at the probe, the mean over all directions"),
        Field("vec3", "probe_scale", "the light now over that in which the probe was drawn"),
        Field("float", "glint_count", "how many of the glints are set"),
        Field("vec4", "glints", "position, intensity, axis and size of each", count=GLINT_ROWS * MOST_GLINTS),
    ),
)
BATCH = UniformBlock(
    "Batch",
    "batch",
    1,
    (
        Field("mat4", "model", "from the mover's frame to the world"),
        Field("vec3", "colour", "factor of the texture"),
        Field("float", "tint", "factor of what the coat mirrors"),
        Field("vec3", "emission", "luminance, or the colour of a lamp's light"),
        Field("float", "emission_repeats", "of the emission's texture in one of the body's"),
        Field("vec4", "plane", "of a mirror, where it is"),
        Field("float", "eta", "of the coat"),
        Field("float", "inner_reflectance", "share that the coat sends back down"),
        Field("float", "inverse_eta_squared", "1 / eta^2"),
        Field("float", "arriving_over_entering", "illuminance over what enters the coat"),
        Field("float", "metal", "share that is metal"),
        Field("float", "grazing_rise", "of the reflectance of a rough coat"),
        Field("float", "grazing_exponent", "of that rise; 0 for a smooth coat"),
        Field("float", "metal_rise", "of the reflectance of metal"),
        Field("float", "cutout", "least opacity that is drawn"),
        Field("float", "roughness", "GGX alpha"),
        Field("float", "probe_level", "level of the probe that is as blurred"),
        Field("float", "probe_share", "how much of the probe is shown"),
        Field("float", "area_glint_share", "how much of the glints of area lights is shown"),
        Field("float", "normal_reflectance", "of a rough coat at normal incidence"),
    ),
)
BLOCKS = {block.name: block for block in (PASS, BATCH)}
