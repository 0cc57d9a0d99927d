"""Light: bakes it into maps, and makes pictures and exact depth of a scene."""

import os

# Before any import of PyOpenGL or pyrender, whichever module of this room needs it first: PyOpenGL chooses its platform
# as it is imported, and pyrender's viewer imports pyglet, which otherwise loads X11's libraries, which a bare machine
# lacks.
os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
os.environ.setdefault("PYGLET_HEADLESS", "1")
