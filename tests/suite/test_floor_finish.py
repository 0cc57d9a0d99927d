"""The floor of a place gets another material, and everything else keeps its own."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from tests.generated import write_cell
from vobench.errors import SuiteError
from vobench.scene.material import Material
from vobench.scene.mesh import quad
from vobench.scene.paint import Paint, PaintedTexture
from vobench.scene.triangles import Thing
from vobench.suite.floor_finish import FLOOR, with_floor
from vobench.suite.scene_build import build
from vobench.suite.scene_entry import generated_scene
from vobench.suite.scene_file import read_scene
from vobench.suite.scene_spec import PolishedSpec


def square(name: str, side_m: float, z_m: float, *, rise_m: float = 0.0) -> Thing:
    """A square around the origin that rises along x."""
    corner_m = (-side_m / 2, -side_m / 2, z_m)
    return Thing(name, quad(corner_m, (side_m, 0, rise_m), (0, side_m, 0)), "old")


def test_what_lies_at_the_height_of_the_floor_gets_its_material() -> None:
    things = [square("slab", 6, 0.0), square("rug", 2, 0.005), square("table", 2, 0.7), square("ceiling", 6, 2.5)]
    materials = {thing.name: thing.material for thing in with_floor(things)}
    assert materials == {"slab": FLOOR, "rug": FLOOR, "table": "old", "ceiling": "old"}


def test_the_lining_of_a_doorway_keeps_its_material_although_it_has_a_strip_of_floor() -> None:
    strip = quad((0, 3, 0), (0.8, 0, 0), (0, 0.15, 0))
    jambs = [quad((x, 3, 0), (0, 0.15, 0), (0, 0, 2)) for x in (0.0, 0.8)]
    lining = Thing("lining", trimesh.util.concatenate([strip, *jambs]), "old")
    materials = {thing.name: thing.material for thing in with_floor([square("slab", 6, 0.0), lining])}
    assert materials == {"slab": FLOOR, "lining": "old"}


def test_a_place_of_slopes_has_no_floor_to_replace() -> None:
    with pytest.raises(SuiteError, match="the scene has no level floor"):
        with_floor([square("hill", 6, 0.0, rise_m=2.0)])


@pytest.fixture
def cell(tmp_path):
    """The spec of a cell of a generator."""
    write_cell(tmp_path / "cell")
    return generated_scene(read_scene(tmp_path / "cell" / "scene.yaml"), 1, "day")


def test_the_floor_of_a_generated_place_is_replaced_and_nothing_else(cell) -> None:
    marble = PolishedSpec("terrazzo", 0.4, contrast=0.5, resolution_px=64)
    plain = build(cell, {})
    polished = build(replace(cell, floor=marble), {})
    for before, after in zip(plain.things, polished.things, strict=True):
        assert after.material == (FLOOR if before.name == "floor" else before.material)
        np.testing.assert_array_equal(after.mesh.vertices, before.mesh.vertices)
    assert polished.materials[FLOOR] == marble.build()
    assert {name: polished.materials[name] for name in plain.materials} == plain.materials


def test_paint_is_over_all_materials_and_also_over_a_floor_that_is_replaced(cell) -> None:
    marble = PolishedSpec("terrazzo", 0.4, contrast=0.5, resolution_px=64)
    painted = build(replace(cell, floor=marble, paint=Paint(cover=0.9)), {})
    assert isinstance(painted.materials[FLOOR].texture, PaintedTexture)
    assert isinstance(painted.materials["paving"].texture, PaintedTexture)
    bare = Material(colour=build(cell, {}).materials["plaster"].colour)
    np.testing.assert_allclose(painted.materials["plaster"].colour, 0.1 * np.array(bare.colour) + 0.45)
