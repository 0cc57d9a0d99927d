"""The levels of a prefiltered cube map show the surroundings, more blurred with each level."""

import numpy as np
import pytest

pytest.importorskip("OpenGL.GL")

from OpenGL import GL

from vobench.rendering.cube_map import CAPABILITIES, PrefilteredCubeMap
from vobench.rendering.probe import FACES

SIZE_PX = 16
ROUGHNESS = (0.0, 0.1, 0.4)


@pytest.fixture(autouse=True, scope="module")
def capabilities(gl_context: None) -> None:
    for capability in CAPABILITIES:
        GL.glEnable(capability)


def faces_of(cube: PrefilteredCubeMap, level: int) -> np.ndarray:
    """The six faces (6, N, N, 3) at a level."""
    GL.glBindTexture(GL.GL_TEXTURE_CUBE_MAP, cube.id)
    faces = []
    for face in range(6):
        buffer = GL.glGetTexImage(GL.GL_TEXTURE_CUBE_MAP_POSITIVE_X + face, level, GL.GL_RGB, GL.GL_FLOAT)
        faces.append(np.frombuffer(buffer, np.float32).reshape(SIZE_PX >> level, SIZE_PX >> level, 3))
    return np.array(faces)


def test_the_first_level_is_the_pictures() -> None:
    pictures = np.random.default_rng(0).random((6, SIZE_PX, SIZE_PX, 3)).astype(np.float32)
    cube = PrefilteredCubeMap([list(pictures)], [0] * len(ROUGHNESS), FACES, ROUGHNESS)
    np.testing.assert_array_equal(faces_of(cube, 0), pictures)


def test_uniform_surroundings_stay_as_they_are_at_every_roughness() -> None:
    colour = np.array([0.5, 1.0, 2.0], np.float32)
    pictures = np.broadcast_to(colour, (6, SIZE_PX, SIZE_PX, 3))
    cube = PrefilteredCubeMap([list(pictures)], [0] * len(ROUGHNESS), FACES, ROUGHNESS)
    for level in range(len(ROUGHNESS)):
        np.testing.assert_allclose(faces_of(cube, level), np.broadcast_to(colour, faces_of(cube, level).shape), 1e-5)


def test_a_bright_side_stays_where_it_is_and_is_blurred_more_by_more_roughness() -> None:
    pictures = np.zeros((6, SIZE_PX, SIZE_PX, 3), np.float32)
    pictures[2] = 1.0
    cube = PrefilteredCubeMap([list(pictures)], [0] * len(ROUGHNESS), FACES, ROUGHNESS)
    contrasts = []
    for level in range(len(ROUGHNESS)):
        means = faces_of(cube, level).mean((1, 2, 3))
        assert means.argmax() == 2
        contrasts.append(means[2] - means[[0, 1, 4, 5]].mean())
    assert contrasts[0] == 1
    assert contrasts == sorted(contrasts, reverse=True)


def test_the_state_is_restored() -> None:
    pictures = np.ones((6, SIZE_PX, SIZE_PX, 3), np.float32)
    PrefilteredCubeMap([list(pictures)], [0] * len(ROUGHNESS), FACES, ROUGHNESS)
    assert all(GL.glIsEnabled(capability) for capability in CAPABILITIES)
