"""The preprocessor names by which the shaders `surface`, `panorama` and `mean` are adapted to what they draw."""

from enum import StrEnum


class ShaderDefine(StrEnum):
    """A preprocessor name of a shader."""

    # The framebuffer.
    IS_MONO = "IS_MONO"  # it has one channel

    # The view.
    IS_MIRRORED = "IS_MIRRORED"  # the view is the image in a mirror
    HAS_FOG = "HAS_FOG"

    # The batch.
    IS_PLANAR = "IS_PLANAR"  # its faces lie in one plane, in which the scene is mirrored
    IS_PANE = "IS_PANE"
    IS_MIRROR = "IS_MIRROR"
    IS_LAMP = "IS_LAMP"
    IS_GREY = "IS_GREY"  # its three channels are equal
    HAS_GLOSS = "HAS_GLOSS"
    HAS_METAL = "HAS_METAL"
    HAS_TEXTURE = "HAS_TEXTURE"
    HAS_LIGHT = "HAS_LIGHT"  # it shows the light map
    HAS_CUTOUT = "HAS_CUTOUT"
    HAS_EMISSION = "HAS_EMISSION"
    HAS_EMISSION_TEXTURE = "HAS_EMISSION_TEXTURE"

    # The part of a surface with holes that is drawn.
    IS_SOLID = "IS_SOLID"
    IS_RIM = "IS_RIM"

    # The source of what is reflected.
    HAS_PROBE = "HAS_PROBE"
    HAS_REFLECTION = "HAS_REFLECTION"  # a picture drawn from behind the mirror
    IS_LAST = "IS_LAST"  # the mean luminance of the scene


Defines = frozenset[ShaderDefine]
NO_DEFINES: Defines = frozenset()
