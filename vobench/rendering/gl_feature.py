"""The features of an OpenGL driver that drawing needs."""

from vobench.rendering.gl_library import FUNCTIONS

SHADER_EXTENSIONS = ("GL_ARB_shading_language_420pack", "GL_ARB_shader_viewport_layer_array")
OLDEST_GLSL = 4.1
COLOUR_FORMATS = ("GL_R32F", "GL_RGBA32F")


def missing_features() -> list[str]:
    """The features that drawing needs and the driver of the current context lacks, each in words, for messages."""
    from OpenGL import GL

    missing = [f"{name} ({purpose})" for name, purpose in FUNCTIONS.items() if not bool(getattr(GL, name))]
    language = GL.glGetString(GL.GL_SHADING_LANGUAGE_VERSION).decode("ascii", "replace")
    if float(language.split()[0]) < OLDEST_GLSL:
        missing.append(f"GLSL {OLDEST_GLSL} (it has {language})")
    count = int(GL.glGetIntegerv(GL.GL_NUM_EXTENSIONS))
    extensions = {GL.glGetStringi(GL.GL_EXTENSIONS, index).decode("ascii", "replace") for index in range(count)}
    missing += [name for name in SHADER_EXTENSIONS if name not in extensions]
    if missing:
        return missing
    return [f"a float framebuffer ({name})" for name in COLOUR_FORMATS if not _completes(getattr(GL, name))]


def _completes(colour_format: int) -> bool:
    """Whether a framebuffer of two layers with a colour format and float depth can be drawn into."""
    from OpenGL import GL

    framebuffer = GL.glGenFramebuffers(1)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
    attachments = (
        (GL.GL_COLOR_ATTACHMENT0, colour_format, GL.GL_RED),
        (GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F, GL.GL_DEPTH_COMPONENT),
    )
    textures = []
    for attachment, internal_format, pixel_format in attachments:
        texture = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, texture)
        GL.glTexImage3D(GL.GL_TEXTURE_2D_ARRAY, 0, internal_format, 4, 4, 2, 0, pixel_format, GL.GL_FLOAT, None)
        GL.glFramebufferTexture(GL.GL_FRAMEBUFFER, attachment, texture, 0)
        textures.append(texture)
    status = GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER)
    GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, 0)
    GL.glDeleteFramebuffers(1, [framebuffer])
    GL.glDeleteTextures(textures)
    return bool(status == GL.GL_FRAMEBUFFER_COMPLETE)
