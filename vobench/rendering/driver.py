"""Which OpenGL driver draws on this machine."""

from functools import cache

from vobench.rendering.raster import context, release


@cache
def driver_name() -> str:
    """The renderer and version that OpenGL states, such as `llvmpipe (LLVM 19.1.7, 256 bits), Mesa 25.0.7`.

    Raises MissingDependencyError where this machine cannot draw.
    """
    platform = context()
    try:
        from OpenGL import GL

        renderer = GL.glGetString(GL.GL_RENDERER).decode(errors="replace")
        version = GL.glGetString(GL.GL_VERSION).decode(errors="replace")
    finally:
        release(platform)
    # As in `4.5 (Core Profile) Mesa 25.0.7-2` and `4.6.0 NVIDIA 550.54`: the driver's version stands last.
    driver = " ".join(word for word in version.split()[1:] if not word.startswith("(") and not word.endswith(")"))
    return f"{renderer}, {driver}" if driver else renderer
