"""Cells of planes in which shadows are known: what they decide is what rays find, and they decide most of a plane."""

from collections.abc import Sequence

import numpy as np
import pytest
from trimesh import Trimesh, creation

from tests.rendering.rectangles import Rectangle, rectangle, room
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering import shadow_cells
from vobench.rendering.lamp import Lamp
from vobench.rendering.occlusion import Occluders
from vobench.rendering.receiver_plane import large_planes
from vobench.rendering.truth import CameraShot, TruthCaster
from vobench.scene.light import AreaLight, Light, PointLight, SpotLight, Sun
from vobench.scene.material import Material
from vobench.scene.mesh import flat_shaded
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light
from vobench.scene.triangles import Thing


def icosphere(center_m: Sequence[float], radius_m: float, *, splits: int) -> Trimesh:
    ball = creation.icosphere(subdivisions=splits, radius=radius_m)
    return flat_shaded(ball.vertices + np.asarray(center_m), ball.faces, np.zeros((len(ball.vertices), 2)))


DOWN = np.array([0.0, 0.0, -1.0])
ABOVE = se3.transform(np.diag([1.0, -1.0, -1.0]), [0, 0, 2.6])
TOP = Pinhole(320, 320, 200.0, 200.0, 159.5, 159.5)
MATERIALS = {"diffuse": Material(), "glass": Material("pane")}
LIGHTS: list[Light] = [
    PointLight("bulb", np.array([0.3, -0.2, 1.9]), 100.0),
    ceiling_light("panel", np.array([-0.6, 0.5, 2.5]), (0.6, 0.3), power_lm=100.0),
    SpotLight("spot", np.array([0.5, 0.6, 2.2]), DOWN, 100.0, 20.0, 30.0),
    AreaLight("ball", icosphere([-0.8, -0.7, 1.6], 0.15, splits=1), 100.0),
    Sun("sun", 1e5, (0.0,), (30.0,), (50.0,)),
]


def shards(seed: int) -> list[Thing]:
    """Triangles of all sizes above a floor; some cut through it, some are higher than the lamps."""
    rng = np.random.default_rng(seed)
    middles_m = rng.uniform([-1.5, -1.5, -0.1], [1.5, 1.5, 2.4], (60, 1, 3))
    sizes_m = rng.choice([0.05, 0.5], (60, 1, 1))
    corners_m = middles_m + sizes_m * rng.uniform(-1, 1, (60, 3, 3))
    things = []
    for index, corners in enumerate(corners_m):
        mesh = flat_shaded(corners, [[0, 1, 2]], np.zeros((3, 2)))
        things.append(Thing(f"shard {index}", mesh, "glass" if index % 10 == 0 else "diffuse"))
    return things


def shadow(caster: TruthCaster, t_ns: int = 0) -> Array:
    result = caster.frame(TOP, CameraShot(ABOVE, t_ns), ["shadow"]).shadow
    assert result is not None
    return result


@pytest.mark.parametrize("seed", range(4))
def test_shadows_with_known_cells_are_those_of_a_ray_for_every_pixel_and_lamp(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [0.4, 0.1, 0]]), np.zeros(2))
    ball = Thing("ball", icosphere([0.2, 0.1, 0.8], 0.2, splits=2), "diffuse")
    things = (*room((4, 4, 3), floor="diffuse", wall="diffuse", ceiling="diffuse")[:1], *shards(seed))
    scene = Scene("shards", things, MATERIALS, tuple(LIGHTS), (Mover("ball", (ball,), path),))
    by_rays = TruthCaster(scene)
    times_ns = (0, 500_000_000)
    expected = [shadow(by_rays, t_ns) for t_ns in times_ns]

    monkeypatch.setattr(shadow_cells, "MIN_PIXELS", 1)
    monkeypatch.setattr(shadow_cells, "MIN_PIXELS_PER_CELL", 0)
    caster = TruthCaster(scene)
    np.testing.assert_array_equal(shadow(caster), expected[0])
    decided_cells = []
    bits = shadow_cells.KnownShadows.bits

    def watched(known: shadow_cells.KnownShadows, *arguments: Array) -> tuple[Array, Array]:
        decided, hidden = bits(known, *arguments)
        decided_cells.append(np.bitwise_count(decided).mean() / len(LIGHTS))
        return decided, hidden

    monkeypatch.setattr(shadow_cells.KnownShadows, "bits", watched)
    for t_ns, values in zip(times_ns, expected, strict=True):
        np.testing.assert_array_equal(shadow(caster, t_ns), values)
    assert np.mean(decided_cells) > 0.3
    assert len(np.unique(expected)) > 3


def plate(half_m: float) -> Rectangle:
    """A square half a metre above the origin."""
    return rectangle(np.array([0, 0, 0.5]), np.array([2 * half_m, 0, 0]), np.array([0, 2 * half_m, 0]), "diffuse")


def floor_cells(lamp: Lamp, *things: Rectangle) -> tuple[Array, shadow_cells.ShadowCells]:
    """The distances (H·W,) of cells on a floor of 2 m from its middle, along the farther axis, and what is known."""
    corners_m = np.concatenate([thing.mesh.triangles for thing in (floor(), *things)])
    normals = np.tile([0.0, 0, 1], (len(corners_m), 1))
    on_floor = np.arange(len(corners_m)) < 2
    [plane], _ = large_planes(corners_m, normals, on_floor, 1e-4)
    cells = shadow_cells.shadow_cells(plane, (lamp,), Occluders(corners_m, np.ones(len(corners_m), bool)))
    row, column = np.divmod(np.arange(plane.height * plane.width), plane.width)
    middles_m = plane.origin_m + plane.cell_m * (
        (column + 0.5)[:, None] * plane.u_axis + (row + 0.5)[:, None] * plane.v_axis
    )
    return np.abs(middles_m[:, :2]).max(1), cells


def floor() -> Rectangle:
    return rectangle(np.zeros(3), np.array([2.0, 0, 0]), np.array([0, 2.0, 0]), "diffuse")


def test_only_cells_across_the_border_of_a_shadow_are_undecided() -> None:
    bulb = Lamp(np.array([0.0, 0, 1.0]), np.zeros(3))
    distance_m, cells = floor_cells(bulb, plate(0.2))
    half_m = 0.4  # of the shadow
    is_decided = cells.decided[:-1] > 0
    is_hidden = cells.hidden[:-1] > 0
    assert not is_decided[np.abs(distance_m - half_m) < 0.009].any()
    assert is_decided[distance_m > half_m + 0.021].all()
    assert not is_hidden[distance_m > half_m].any()
    # Cells on the plate's diagonal are covered by neither of its two triangles.
    is_inside = distance_m < half_m - 0.021
    assert is_hidden[is_inside].mean() > 0.9
    assert (is_hidden == is_decided)[is_inside].all()


def test_a_plate_above_the_lamp_or_below_the_floor_hides_nothing() -> None:
    bulb = Lamp(np.array([0.0, 0, 0.4]), np.zeros(3))
    _, cells = floor_cells(bulb, plate(0.2))
    assert (cells.decided[:-1] == 1).all()
    assert not cells.hidden.any()


def test_nothing_is_decided_outside_the_grid_or_for_a_lamp_behind_the_plane() -> None:
    _, cells = floor_cells(Lamp(np.array([0.0, 0, -1.0]), np.zeros(3)), plate(0.2))
    assert not cells.decided.any()
    _, cells = floor_cells(Lamp(np.array([0.0, 0, 1.0]), np.zeros(3)), plate(0.2))
    outside = cells.plane.cell(np.array([[5.0, 0, 0], [0, -5.0, 0]], np.float32))
    assert not cells.decided[outside].any()


def test_a_spot_decides_nothing_at_the_rim_of_its_cone() -> None:
    spot = Lamp(np.array([0.0, 0, 1.0]), DOWN, float(np.cos(np.arctan(0.5))))
    _, cells = floor_cells(spot)
    plane = cells.plane
    rim = np.array([[0.5, 0, 0], [0, -0.5, 0], [0.3, 0.4, 0]], np.float32)
    assert not cells.decided[plane.cell(rim)].any()
    assert cells.decided[plane.cell(0.8 * rim)].all()
    assert cells.decided[plane.cell(1.2 * rim)].all()
    assert not cells.hidden.any()
