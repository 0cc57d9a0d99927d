"""A luminous model that is written is read as it was."""

from pathlib import Path

import numpy as np
import pytest

from vobench.asset.luminous_model import Surface, write_luminous_model
from vobench.asset.model import read_model
from vobench.scene.mesh import texture_coordinates


def test_a_model_has_the_surfaces_and_the_light_of_their_textures(tmp_path: Path) -> None:
    vertices_m = np.array([[0.0, 0, 0], [2, 0, 0], [0, 0, 3]])
    uv = np.array([[0.1, 0.2], [0.9, 0.2], [0.1, 0.8]])
    texture = np.random.default_rng(0).integers(0, 256, (20, 30), dtype=np.uint8)
    surface = Surface(vertices_m, uv, np.array([[0, 1, 2]]), texture)
    write_luminous_model([surface, surface], tmp_path / "two.glb")

    model = read_model(tmp_path / "two.glb")
    assert len(model.things) == 2
    for thing in model.things:
        assert np.asarray(thing.mesh.vertices) == pytest.approx(vertices_m)
        assert thing.mesh.faces.tolist() == [[0, 1, 2]]
        material = model.materials[thing.material]
        assert material.emission_cd_m2 == (1.0, 1.0, 1.0)
        assert material.emission_texture is not None
        tile = material.emission_texture.tile_m
        assert texture_coordinates(thing.mesh) / tile == pytest.approx(uv, abs=1e-6)
        pixels = material.emission_texture.pixels()
        assert (pixels[..., :3] == texture[..., None]).all()
