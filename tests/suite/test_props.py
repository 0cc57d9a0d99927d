"""Props move rigidly with the path that they are around, and need the floor below them."""

import numpy as np
import pytest

from tests.generated import write_cell
from vobench.motion.free_start import Relocation, Start
from vobench.suite.props import BOARD_RADIUS_M, MOVER_RADIUS_M, Props
from vobench.suite.scene_build import build
from vobench.suite.scene_entry import generated_scene
from vobench.suite.scene_file import read_scene
from vobench.suite.scene_spec import BoardSpec, DiffuseSpec, MoverSpec, PathKey

BOARD = BoardSpec(name="gate", center_m=(1.0, 0.5, 0.6), size_m=(1.2, 1.2), yaw_deg=90, material="plaster")
WALKER = MoverSpec(
    name="walker",
    kind="person",
    path=(PathKey(t_s=0, position_m=(0, 1, 0), yaw_deg=0), PathKey(t_s=2, position_m=(2, 1, 0), yaw_deg=0)),
)
PROPS = Props(materials={"plaster": DiffuseSpec("plain", 0.9)}, boards=(BOARD,), movers=(WALKER,))
TO_THE_LEFT = Relocation(Start(1.0, 0.0, 0.0), Start(-2.0, 3.0, 90.0))


def test_a_relocation_takes_one_start_to_the_other_and_back() -> None:
    points_m = np.random.default_rng(1).uniform(-3, 3, (20, 2))
    there = TO_THE_LEFT.points_m(points_m)
    np.testing.assert_allclose(TO_THE_LEFT.points_m(np.array([1.0, 0.0])), [-2, 3], atol=1e-12)
    np.testing.assert_allclose(TO_THE_LEFT.points_m(np.array([2.0, 0.0])), [-2, 4], atol=1e-12)
    np.testing.assert_allclose(Relocation(TO_THE_LEFT.new, TO_THE_LEFT.old).points_m(there), points_m, atol=1e-12)


def test_boards_and_the_paths_of_movers_are_relocated_at_their_heights() -> None:
    moved = PROPS.relocated(TO_THE_LEFT)
    (board,) = moved.boards
    np.testing.assert_allclose(board.center_m, [-2.5, 3.0, 0.6], atol=1e-12)
    assert board.yaw_deg == 180
    (walker,) = moved.movers
    np.testing.assert_allclose([key.position_m for key in walker.path], [[-3, 2, 0], [-3, 4, 0]], atol=1e-12)
    assert [key.yaw_deg for key in walker.path] == [90, 90]
    assert moved.materials == PROPS.materials


def test_the_floor_that_is_used_lies_below_boards_and_along_paths_and_moves_with_them() -> None:
    floor_use = PROPS.floor_use
    of_board = floor_use.points_m[floor_use.radius_m == BOARD_RADIUS_M]
    of_walker = floor_use.points_m[floor_use.radius_m == MOVER_RADIUS_M]
    np.testing.assert_allclose([of_board.min(0), of_board.max(0)], [[0.4, 0.5], [1.6, 0.5]], atol=1e-12)
    np.testing.assert_allclose([of_walker.min(0), of_walker.max(0)], [[0, 1], [2, 1]], atol=1e-12)
    assert np.diff(of_walker[:, 0]).max() < 0.11
    moved = PROPS.relocated(TO_THE_LEFT).floor_use
    np.testing.assert_allclose(moved.points_m, TO_THE_LEFT.points_m(floor_use.points_m), atol=1e-12)
    assert len(Props().floor_use.points_m) == 0


@pytest.fixture
def cell(tmp_path):
    """The spec of a cell of a generator, which has a material `plaster`, too."""
    write_cell(tmp_path / "cell")
    return generated_scene(read_scene(tmp_path / "cell" / "scene.yaml"), 1, "day")


def test_a_generated_place_with_props_keeps_its_own_materials(cell) -> None:
    bare = build(cell, {})
    furnished = build(PROPS.in_scene(cell), {})
    names = {thing.name: thing.material for thing in furnished.things}
    assert names == {**{thing.name: thing.material for thing in bare.things}, "gate": "prop.plaster"}
    assert furnished.materials["plaster"] == bare.materials["plaster"]
    assert furnished.materials["prop.plaster"] == PROPS.materials["plaster"].build()
    assert {mover.name for mover in furnished.movers} == {"walker"}
