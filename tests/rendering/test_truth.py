"""Ground truth agrees with geometry worked out apart from it: no Embree, float64, one triangle at a time."""

from dataclasses import replace

import numpy as np
import pytest
from trimesh import Trimesh

from vobench.asset.texture import Procedural
from vobench.errors import UnknownNameError
from vobench.geometry import se3
from vobench.geometry.camera import (
    BrownConrady,
    Camera,
    DoubleSphere,
    Equirectangular,
    KannalaBrandt,
    Pinhole,
    pixel_grid,
)
from vobench.geometry.rig import LENSES, looking
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.rendering.lamp import lamp_of
from vobench.rendering.truth import CameraShot, TruthCaster
from vobench.scene.light import PointLight, Sky, SpotLight, Sun, Switched
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import flat_shaded, flipped, joined, moved, quad, two_sided
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light, triangles
from vobench.scene.triangles import Thing, Triangles
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame

PLAIN = ("plain", 0.5, 0.0, 1.0, 8, 0)
MATERIALS = {
    "diffuse": Material(texture=Procedural(*PLAIN)),
    "wax": Material(texture=Procedural(*PLAIN), eta=1.5),
    "steel": Material("mirror", tint=0.9),
    "glass": Material("pane", eta=1.5),
}
SECOND_NS = 1_000_000_000


def sheet(name: str, center_m, edge_u_m, edge_v_m, material: str = "diffuse") -> Thing:
    """A rectangle around a middle."""
    u, v = np.asarray(edge_u_m, float), np.asarray(edge_v_m, float)
    return Thing(name, quad(np.asarray(center_m) - (u + v) / 2, u, v), material)


def sides(center_m, size_m, *, yaw_deg: float = 0.0) -> list[Trimesh]:
    """The sides of a block, seen from outside: east, west, north, south, top, bottom."""
    x, y, z = np.diag(np.asarray(size_m, float)) @ se3.rotation_z(np.deg2rad(yaw_deg)).T
    ways = ((x, y, z), (-x, z, y), (y, z, x), (-y, x, z), (z, x, y), (-z, y, x))
    return [quad(np.asarray(center_m) + (out - u - v) / 2, u, v) for out, u, v in ways]


def block(name: str, center_m, size_m, *, yaw_deg: float = 0.0) -> Thing:
    return Thing(name, joined(sides(center_m, size_m, yaw_deg=yaw_deg)), "diffuse")


def shell(size_m, *, floor: str = "diffuse") -> list[Thing]:
    """The inner sides of a block that stands on the floor."""
    names = ("wall_east", "wall_west", "wall_north", "wall_south", "ceiling", "floor")
    meshes = [flipped(side) for side in sides([0, 0, size_m[2] / 2], size_m)]
    return [Thing(n, mesh, floor if n == "floor" else "diffuse") for n, mesh in zip(names, meshes, strict=True)]


RIDE = WaypointMotion(np.array([0.0, 2.0]), np.array([[1.5, -1.2, 0.3], [1.9, 1.0, 0.3]]), np.array([0.0, 50.0]))
CART = Mover("cart", (block("x", np.zeros(3), (0.5, 0.4, 0.6)),), RIDE)
PANE = sheet("pane", [1.0, 0.4, 0.8], [0, 0.6, 0], [0, 0, 0.5], "glass")
HALL = Scene(
    "hall",
    (
        *shell((8, 6, 3), floor="wax"),
        block("crate", [2.0, 0.9, 0.4], (0.8, 0.6, 0.8), yaw_deg=30),
        block("shelf", [-2.0, -1.5, 0.7], (0.3, 1.6, 1.4), yaw_deg=-12),
        sheet("mirror", [3.99, -1.0, 1.2], [0, 0, 1.0], [0, 1.5, 0], "steel"),
        PANE,
    ),
    MATERIALS,
    (ceiling_light("lamp", np.array([0.5, 0.5, 2.9]), (0.6, 0.6), power_lm=1000),),
    (CART,),
)
CAMERAS = {
    "pinhole": Pinhole(177, 119, 120.0, 100.0, 90.0, 55.0),
    "brown": BrownConrady(177, 119, 120.0, 110.0, 90.0, 55.0, -0.28, 0.07, 1e-3, -5e-4),
    "kannala": KannalaBrandt(160, 160, 70.0, 70.0, 80.0, 79.0, -0.1, 0.0, 0.0, 0.0),
    "sphere": DoubleSphere(160, 120, 60.0, 60.0, 79.5, 59.5, -0.2, 0.59),
    "around": Equirectangular(180, 90),
}
HERE = se3.transform(se3.rotation_z(-0.1), (-1.1, 0.1, 0)) @ looking(pitch_deg=12, position_m=(0.25, 0.06, 0.5))
NEXT = se3.transform(se3.rotation_z(-0.05), (-0.99, 0.16, 0)) @ looking(pitch_deg=12, position_m=(0.25, 0.06, 0.5))
STEP_NS = SECOND_NS // 10
NOW, LATER = CameraShot(HERE, 0), CameraShot(NEXT, STEP_NS)


def met(faces: Triangles, origin_m: Array, directions: Array) -> Array:
    """How far along directions (R, 3) the fronts of faces are (R, F), infinite for none. Source: Cramer's rule."""
    a, b, c = np.moveaxis(faces.corners_m, 1, 0)
    normal, way = np.cross(b - a, c - a), origin_m - a
    across = np.cross(way, directions[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = -1 / (directions @ normal.T)
        t = np.einsum("fi,fi->f", way, normal) * scale
        u, v = np.einsum("fi,rfi->rf", c - a, across) * scale, -np.einsum("fi,rfi->rf", b - a, across) * scale
        return np.where((scale > 0) & (t > 0) & (u >= 0) & (v >= 0) & (u + v <= 1), t, np.inf)


def nearest(scene: Scene, origin_m: Array, directions: Array, *, t_ns: float) -> tuple[Array, Array]:
    """The first opaque front along each direction (R, 3): face, -1 for none, and lengths, infinite for none."""
    faces = triangles(scene, t_ns=t_ns)
    glass = {name for name, material in scene.materials.items() if material.kind == "pane"}
    pane = np.array([thing.material in glass for thing in faces.things])[faces.thing]
    which, best = [], []
    for some in np.array_split(directions, max(1, len(directions) * len(faces) // 1_000_000)):
        distance = np.where(pane, np.inf, met(faces, origin_m, some))
        which.append(distance.argmin(1))
        best.append(distance.min(1))
    length = np.concatenate(best)
    return np.where(np.isfinite(length), np.concatenate(which), -1), length


@pytest.fixture(scope="module")
def caster() -> TruthCaster:
    return TruthCaster(HALL)


@pytest.fixture(scope="module", params=CAMERAS.values(), ids=list(CAMERAS))
def camera(request: pytest.FixtureRequest) -> Camera:
    return request.param


@pytest.fixture(scope="module")
def truth(caster: TruthCaster, camera: Camera) -> TruthFrame:
    return caster.frame(camera, NOW, later=LATER)


@pytest.fixture(scope="module")
def expected(camera: Camera) -> tuple[Array, Array, Array]:
    """Faces (R,), distances (R,) and rays (R, 3)."""
    rays = camera.rays(pixel_grid(camera)).reshape(-1, 3)
    return *nearest(HALL, HERE[:3, 3], rays @ HERE[:3, :3].T, t_ns=0), rays


def flattened(channel: np.ndarray | None) -> np.ndarray:
    assert channel is not None
    return channel.reshape(-1, *channel.shape[2:])


def off_edges(same: np.ndarray) -> np.ndarray:
    """All but a few: rays that graze an edge may fall on either side of it."""
    assert same.mean() > 0.9995
    return same


def test_every_camera_has_depth_to_1e_6_where_planes_put_it(truth, expected, camera):
    surface, distance_m, rays = expected
    depth = flattened(truth.depth)
    exact = distance_m * (rays[:, 2] if camera.depth_along == "axis" else 1.0)
    unseen = surface < 0
    assert np.isnan(depth[unseen]).all()
    error = np.abs(depth[~unseen] / exact[~unseen] - 1)
    assert np.isfinite(depth[~unseen]).all()
    off_edges(error < 1e-6)


def test_pixels_that_no_direction_leads_to_have_no_truth(caster):
    camera = CAMERAS["kannala"]
    truth, dark = caster.frame(camera, NOW, later=LATER), np.isnan(camera.rays(pixel_grid(camera))[..., 0])
    assert 0.01 < dark.mean() < 0.5
    for name, values in truth.channels().items():
        nothing = np.isnan(values[dark]) if values.dtype == np.float32 else values[dark] == 0
        assert nothing.all(), name


def test_depth_is_exact_to_20_m_at_grazing_angles():
    floor = sheet("floor", np.zeros(3), [60.0, 0, 0], [0, 60.0, 0])
    camera, pose = LENSES["paper_literal"], looking(pitch_deg=15, position_m=(0, 0, 0.4))
    depth = TruthCaster(Scene("plain", (floor,), MATERIALS, ())).frame(camera, CameraShot(pose, 0), ["depth"]).depth
    assert depth is not None
    rays = camera.rays(pixel_grid(camera))
    exact = rays[..., 2] * -0.4 / (rays @ pose[:3, :3].T)[..., 2]
    near = (exact > 0) & (exact < 20)
    assert exact[near].max() > 19
    assert np.abs(depth[near] / exact[near] - 1).max() < 1e-6
    assert np.isnan(depth[exact < 0]).all()


def test_normals_are_those_of_the_surfaces_in_the_cameras_frame(truth, expected):
    surface = expected[0]
    normals = triangles(HALL, t_ns=0).plane @ HERE[:3, :3]
    seen = surface >= 0
    error = np.abs(flattened(truth.normals)[seen] - normals[surface[seen]]).max(1)
    off_edges(error < 1e-6)


def test_ids_name_what_is_seen_and_movers_by_their_own_name(truth, expected, caster):
    surface, faces = expected[0], triangles(HALL, t_ns=0)
    things = ["cart" if mover >= 0 else faces.things[n].name for n, mover in zip(faces.thing, faces.mover, strict=True)]
    instance = np.array(caster.names.instance)[flattened(truth.instance)]
    material = np.array(caster.names.material)[flattened(truth.material)]
    off_edges(instance == np.array([*things, ""])[surface])
    off_edges(material == np.array([*(faces.things[n].material for n in faces.thing), ""])[surface])
    off_edges(flattened(truth.moving) == (np.append(faces.mover, -1)[surface] >= 0))
    assert {"cart", "crate", "floor", "wall_east"} <= set(instance)
    assert caster.names.instance[0] == caster.names.material[0] == ""


def test_mirrors_coats_and_what_stands_behind_panes_are_in_the_mask(truth, expected):
    surface, distance_m, rays = expected
    faces = triangles(HALL, t_ns=0)
    shiny = np.array([*(faces.things[n].material in {"wax", "steel"} for n in faces.thing), False])[surface]
    both = replace(PANE, mesh=two_sided(PANE.mesh))
    pane = triangles(Scene("pane", (both,), MATERIALS, ()))
    behind = met(pane, HERE[:3, 3], rays @ HERE[:3, :3].T).min(1) < distance_m
    assert behind.any()
    off_edges(flattened(truth.mirror) == (shiny | behind))


def carried(expected: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """The seen points (R, 3) in the next camera's frame, and in the world then."""
    surface, distance_m, rays = expected
    points_m = HERE[:3, 3] + distance_m[:, None] * (rays @ HERE[:3, :3].T)
    onward = RIDE.pose(STEP_NS) @ se3.inverse(RIDE.pose(0))
    moving = np.append(triangles(HALL).mover, -1)[surface] >= 0
    with np.errstate(invalid="ignore"):
        world_m = np.where(moving[:, None], se3.apply(onward, points_m), points_m)
        return se3.apply(se3.inverse(NEXT), world_m), world_m


@pytest.mark.filterwarnings("ignore:invalid value encountered")
def test_flow_is_reprojection_of_what_stands_and_of_what_moves(truth, expected, camera):
    seen = expected[0] >= 0
    uv_px = camera.project(carried(expected)[0])
    flow = uv_px - pixel_grid(camera).reshape(-1, 2)
    error = np.abs(flattened(truth.flow) - flow).max(1)[seen]
    known = np.isfinite(uv_px).all(1)[seen]
    assert np.isnan(error[~known]).all()
    off_edges(error[known] < 1e-3)
    assert np.isnan(flattened(truth.flow)[~seen]).all()


@pytest.mark.filterwarnings("ignore:invalid value encountered")
def test_occlusion_is_what_the_next_camera_does_not_see(truth, expected, camera):
    surface, seen = expected[0], expected[0] >= 0
    points_m, world_m = carried(expected)
    uv_px = camera.project(points_m)
    outside = ~((uv_px >= -0.5) & (uv_px < [camera.width_px - 0.5, camera.height_px - 0.5])).all(1)
    way = world_m - NEXT[:3, 3]
    reach_m = np.linalg.norm(way, axis=1)
    found, distance_m = nearest(HALL, NEXT[:3, 3], way / reach_m[:, None], t_ns=STEP_NS)
    hidden = (found != surface) & (distance_m < reach_m * (1 - 1e-4))
    assert (hidden & ~outside & seen).any()
    off_edges(flattened(truth.occlusion) == (seen & (outside | hidden)))


def test_flow_there_and_back_returns_to_the_pixel(caster):
    camera = CAMERAS["pinhole"]
    there = caster.frame(camera, NOW, later=LATER)
    floor = caster.names.instance.index("floor")
    rows, columns = np.nonzero((there.instance == floor) & ~there.occlusion)
    uv_px = np.stack([columns, rows], -1) + there.flow[rows, columns]
    # The floor's depth from the next place is that of its plane, so the way back needs no pixels between.
    rays = camera.rays(uv_px)
    directions = rays @ NEXT[:3, :3].T
    points_m = NEXT[:3, 3] - NEXT[2, 3] / directions[:, 2:] * directions
    back_px = camera.project(se3.apply(se3.inverse(HERE), points_m))
    assert len(rows) > 1000
    np.testing.assert_allclose(back_px, np.stack([columns, rows], -1), atol=1e-3)


def test_a_camera_and_a_scene_at_rest_have_no_flow_and_hide_nothing(caster):
    truth = caster.frame(CAMERAS["pinhole"], NOW, later=replace(NOW))
    assert np.abs(truth.flow).max() < 1e-4
    assert not truth.occlusion.any()


def test_without_a_next_picture_flow_is_unknown_and_all_is_occluded(caster):
    truth = caster.frame(CAMERAS["pinhole"], NOW, ["flow", "occlusion"])
    assert np.isnan(truth.flow).all()
    assert truth.occlusion.all()


def test_only_what_is_asked_for_is_there_and_it_does_not_depend_on_the_rest(caster):
    camera = CAMERAS["pinhole"]
    whole = caster.frame(camera, NOW, later=LATER).channels()
    assert list(whole) == list(CHANNELS)
    for name, channel in CHANNELS.items():
        alone = caster.frame(camera, NOW, [name], later=LATER).channels()
        assert list(alone) == [name]
        assert alone[name].dtype == channel.dtype
        assert alone[name].shape == channel.shape(camera.height_px, camera.width_px)
        np.testing.assert_array_equal(alone[name], whole[name])


def test_a_channel_that_does_not_exist_is_named(caster):
    with pytest.raises(UnknownNameError, match=r"^no truth channel 'dept'. Known: depth, normals, flow, "):
        caster.frame(CAMERAS["pinhole"], NOW, ["dept"])


def rolling(count: int) -> tuple[CameraShot, CameraShot]:
    """A camera that turns and walks while its rows are exposed, and the picture after it."""
    t_ns = np.arange(count) * 60_000_000 // count

    def at(t: Array) -> Array:
        turned, walked = se3.rotation_z(1.5 * t), np.stack([0.8 * t, 0.3 * t, 0 * t], -1)
        return se3.transform(turned, walked) @ HERE

    return CameraShot(at(t_ns / SECOND_NS), t_ns), CameraShot(at((t_ns + STEP_NS) / SECOND_NS), t_ns + STEP_NS)


def test_each_row_of_a_rolling_shutter_is_that_of_a_still_camera_at_its_instant(caster):
    camera = CAMERAS["pinhole"]
    now, later = rolling(camera.height_px)
    whole = caster.frame(camera, now, later=later)
    for row in (0, 1, 60, camera.height_px - 1):
        still = caster.frame(camera, CameraShot(now.T_world_camera[row], now.t_ns[row]))
        for name in ("depth", "normals", "instance", "material", "mirror", "moving"):
            np.testing.assert_allclose(getattr(whole, name)[row], getattr(still, name)[row], rtol=2e-6, atol=2e-6)


def test_flow_of_a_rolling_shutter_leads_to_where_the_row_that_sees_the_point_stands(caster):
    camera = CAMERAS["pinhole"]
    now, later = rolling(camera.height_px)
    truth = caster.frame(camera, now, later=later)
    rows, columns = np.nonzero(~truth.occlusion & ~truth.moving)
    uv_px = np.stack([columns, rows], -1) + truth.flow[rows, columns]
    rays = camera.rays(np.stack([columns, rows], -1))
    points_m = rays * (truth.depth[rows, columns] / rays[:, 2])[:, None]
    world_m = np.einsum("rij,rj->ri", now.T_world_camera[rows], np.column_stack([points_m, np.ones(len(rows))]))
    # The next picture's pose at a row between two, by the motion's own formula.
    t_s = (uv_px[:, 1] * 60_000_000 / camera.height_px + STEP_NS) / SECOND_NS
    poses = se3.transform(se3.rotation_z(1.5 * t_s), np.stack([0.8 * t_s, 0.3 * t_s, 0 * t_s], -1)) @ HERE
    seen_m = np.einsum("rij,rj->ri", se3.inverse(poses), world_m)[:, :3]
    error_px = np.abs(camera.project(seen_m) - uv_px).max(1)
    between_rows = (uv_px[:, 1] >= 0) & (uv_px[:, 1] <= camera.height_px - 1)
    assert between_rows.sum() > 5000
    assert error_px[between_rows].max() < 1e-3
    assert np.abs(truth.flow[rows, columns, 1]).max() > 1


def stage(*lights, things=(), movers=()):
    """A floor seen from above, one camera pixel to a centimetre, lights over it."""
    floor = sheet("floor", np.zeros(3), [4.0, 0, 0], [0, 4.0, 0])
    return TruthCaster(Scene("stage", (floor, *things), MATERIALS, lights, movers))


ABOVE = se3.transform(np.diag([1.0, -1.0, -1.0]), [0, 0, 2.0])
TOP = Pinhole(201, 201, 200.0, 200.0, 100.0, 100.0)  # column c sees x = (c - 100) / 100 m


def shadow(caster: TruthCaster, *, t_ns: int = 0) -> np.ndarray:
    found = caster.frame(TOP, CameraShot(ABOVE, t_ns), ["shadow"]).shadow
    assert found is not None
    return found


def plate(*, material: str = "diffuse", x_m: float = 0.0) -> Thing:
    """0.2 m square, half a metre above the floor, seen from below and so not from the camera above."""
    return sheet("plate", [x_m, 0, 0.5], [0, 0.2, 0], [0.2, 0, 0], material)


def square(half_m: float, *, x_m: float = 0.0) -> np.ndarray:
    place_m = (np.arange(201) - 100) / 100
    across, down = np.meshgrid(np.abs(place_m - x_m), np.abs(place_m))
    return np.maximum(across, down) - half_m


@pytest.mark.parametrize(
    "light",
    [
        PointLight("bulb", np.array([0, 0, 1.0]), 100.0),
        SpotLight("spot", np.array([0, 0, 1.0]), np.array([0, 0, -1.0]), 100.0, 40.0, 50.0),
        ceiling_light("panel", np.array([0, 0, 1.0]), (0.1, 0.1), power_lm=100.0),
    ],
    ids=lambda light: light.name,
)
def test_shadow_of_a_plate_half_way_to_a_lamp_is_twice_its_size(light):
    found, beside = shadow(stage(light, things=(plate(),))), square(0.2)
    clear_of_panel = square(0.12) > 0  # a panel hides the floor right below it from the camera
    assert (found[(beside < -0.003) & clear_of_panel] == 1).all()
    assert (found[beside > 0.003] == 0).all()


def test_shadow_in_sunlight_is_as_large_as_the_plate_and_moves_with_the_sun():
    sun = Sun("sun", 1e5, (0.0, 10.0), (0.0, 0.0), (90.0, 45.0))
    caster = stage(sun, things=(plate(),))
    for t_ns, x_m in ((0, 0.0), (10 * SECOND_NS, -0.5)):
        found, beside = shadow(caster, t_ns=t_ns), square(0.1, x_m=x_m)
        assert (found[beside < -0.003] == 1).all()
        assert (found[beside > 0.003] == 0).all()


def test_shadow_counts_the_lights_that_are_hidden_and_those_that_are_off_or_the_sky_never():
    bulbs = [PointLight(str(x), np.array([x, 0, 1.0]), 100.0) for x in (0.0, 0.1)]
    off = PointLight("off", np.array([0, 0, 1.0]), 100.0, Switched((5.0,), on_first=False))
    caster = stage(*bulbs, off, Sky("sky", 1e4), things=(plate(),))
    assert shadow(caster)[100, 100] == 2
    assert shadow(caster, t_ns=6 * SECOND_NS)[100, 100] == 3
    assert set(np.unique(shadow(caster))) == {0, 1, 2}


def test_glass_casts_no_shadow_and_a_spot_none_outside_its_cone():
    bulb = PointLight("bulb", np.array([0, 0, 1.0]), 100.0)
    assert not shadow(stage(bulb, things=(plate(material="glass"),))).any()
    narrow = SpotLight("spot", np.array([0, 0, 1.0]), np.array([0, 0, -1.0]), 100.0, 2.0, 5.0)
    assert not shadow(stage(narrow, things=(plate(x_m=0.3),))).any()


def test_shadow_follows_a_mover():
    path = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [0.4, 0, 0]]), np.zeros(2))
    bulb = PointLight("bulb", np.array([0.0, 0, 1.0]), 100.0)
    caster = stage(bulb, movers=(Mover("kite", (plate(),), path),))
    for t_ns, x_m in ((0, 0.0), (SECOND_NS, 0.8)):
        found, beside = shadow(caster, t_ns=t_ns), square(0.2, x_m=x_m)
        assert (found[beside < -0.003] == 1).all()
        assert (found[beside > 0.003] == 0).all()


def test_one_thread_and_two_give_the_same_bytes(caster, monkeypatch):
    camera = LENSES["paper_literal"]
    by_two = caster.frame(camera, NOW, later=LATER).channels()
    monkeypatch.setattr("vobench.rendering.truth.THREADS", 1)
    by_one = TruthCaster(HALL).frame(camera, NOW, later=LATER).channels()
    for name in by_two:
        assert by_two[name].tobytes() == by_one[name].tobytes()


def test_backs_are_not_seen_but_hide_lights():
    ceiling = sheet("ceiling", [0, 0, 1.5], [0, 1.0, 0], [1.0, 0, 0])
    caster = stage(PointLight("bulb", np.array([0, 0, 3.0]), 100.0), things=(ceiling,))
    truth = caster.frame(TOP, CameraShot(ABOVE, 0), ["depth", "shadow"])
    assert (ceiling.mesh.vertex_normals[:, 2] < 0).all()
    np.testing.assert_allclose(truth.depth, 2.0, rtol=1e-6)
    assert truth.shadow[100, 100] == 1


def icosphere(center_m, radius_m: float, *, splits: int) -> Trimesh:
    """A ball of 20 * 4^splits faces whose corners are on it."""
    gold = (1 + 5**0.5) / 2
    pairs = np.array([[-1, gold], [1, gold], [-1, -gold], [1, -gold]])
    corners = np.concatenate([np.roll(np.insert(pairs, 2, 0, axis=1), n, axis=1) for n in range(3)])
    faces = corners[[f for f in np.ndindex(12, 12, 12) if _is_face(corners, f)]]
    for _ in range(splits):
        a, b, c = np.moveaxis(faces, 1, 0)
        ab, bc, ca = a + b, b + c, c + a
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        faces = unit(np.concatenate([np.stack(three, 1) for three in four])) if len(faces) else faces
    vertices = np.asarray(center_m) + radius_m * unit(faces.reshape(-1, 3))
    return flat_shaded(vertices, np.arange(len(vertices)).reshape(-1, 3), np.zeros((len(vertices), 2)))


def _is_face(corners: Array, which: tuple[int, ...]) -> bool:
    a, b, c = corners[list(which)]
    near = np.allclose([np.linalg.norm(a - b), np.linalg.norm(b - c), np.linalg.norm(c - a)], 2)
    return bool(near and which[0] == min(which) and np.cross(b - a, c - a) @ a > 0)


def ball_scene(*, splits: int) -> tuple[TruthCaster, Array, float]:
    center_m, radius_m = np.array([2.0, 0.1, 0.4]), 0.5
    ball = Thing("ball", icosphere(center_m, radius_m, splits=splits), "diffuse")
    return TruthCaster(Scene("ball", (ball,), MATERIALS, ())), center_m, radius_m


@pytest.mark.parametrize("splits", [2, 4])
def test_a_ball_of_faces_is_as_deep_as_the_ball_within_its_faceting(splits):
    caster, center_m, radius_m = ball_scene(splits=splits)
    camera, pose = CAMERAS["pinhole"], looking(pitch_deg=10, position_m=(0, 0, 0.5))
    depth = caster.frame(camera, CameraShot(pose, 0), ["depth"]).depth
    rays = camera.rays(pixel_grid(camera))
    away = center_m - pose[:3, 3]
    along = rays @ pose[:3, :3].T @ away
    square = along**2 - away @ away + radius_m**2
    # Well inside the outline, where rays are at most 45° off the normal.
    inside = square > 0.5 * radius_m**2
    exact = (along - np.sqrt(np.where(inside, square, 0))) * rays[..., 2]
    widest = 1.11 / 2**splits  # the longest edge, as an angle: that of an icosahedron, halved each time
    sag_m = radius_m * (1 - np.cos(0.66 * widest)) * np.sqrt(2)
    deeper = (depth - exact)[inside]
    assert inside.sum() > 200
    assert deeper.min() > -1e-6
    assert 0.1 * sag_m < deeper.max() < sag_m
    assert np.isnan(depth[square < 0]).all()


def test_flow_on_a_ball_is_its_points_projected_again():
    caster, _, _ = ball_scene(splits=3)
    camera, pose = CAMERAS["pinhole"], looking(pitch_deg=10, position_m=(0, 0, 0.5))
    onward = se3.transform(se3.rotation_z(0.02), (0.05, -0.03, 0.01)) @ pose
    truth = caster.frame(camera, CameraShot(pose, 0), later=CameraShot(onward, STEP_NS))
    seen = np.isfinite(truth.depth)
    rays = camera.rays(pixel_grid(camera))[seen]
    points_m = nearest(caster._scene, pose[:3, 3], rays @ pose[:3, :3].T, t_ns=0)[1][:, None] * rays
    expected = camera.project(se3.apply(se3.inverse(onward) @ pose, points_m)) - pixel_grid(camera)[seen]
    assert seen.sum() > 1000
    assert np.abs(truth.flow[seen] - expected).max() < 1e-4


def shards(count: int, seed: int) -> Scene:
    """Triangles anywhere and any way, each a thing of its own, that cut through one another; some in a mover."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform([1, -1.5, -1], [4, 1.5, 1], (count, 3))
    corners = middle[:, None] + rng.uniform(-0.4, 0.4, (count, 3, 3)) * rng.choice([0.1, 1.0], (count, 1, 1))
    things = [
        Thing(
            f"shard {n}",
            two_sided(flat_shaded(c, [[0, 1, 2]], np.zeros((3, 2))))
            if n % 3
            else flat_shaded(c, [[0, 1, 2]], np.zeros((3, 2))),
            "diffuse",
        )
        for n, c in enumerate(corners)
    ]
    path = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.1, 0.2, 0.0], [0.3, 0.1, 0.1]]), np.array([5.0, 20.0]))
    return Scene("shards", tuple(things), MATERIALS, (), (Mover("swarm", tuple(things[::4]), path),))


@pytest.mark.parametrize("seed", range(3))
def test_ids_and_depth_of_many_meshes_are_those_of_every_triangle_tried_in_float64(seed):
    scene = shards(300, seed)
    caster, faces = TruthCaster(scene), triangles(scene, t_ns=STEP_NS)
    camera, pose = CAMERAS["pinhole"], looking(pitch_deg=3, position_m=(0, 0.1, 0.05))
    truth = caster.frame(camera, CameraShot(pose, STEP_NS), ["depth", "instance", "normals"])
    rays = camera.rays(pixel_grid(camera)).reshape(-1, 3)
    face, distance_m = nearest(scene, pose[:3, 3], rays @ pose[:3, :3].T, t_ns=STEP_NS)
    names = ["swarm" if mover >= 0 else faces.things[n].name for n, mover in zip(faces.thing, faces.mover, strict=True)]
    assert (np.array(caster.names.instance)[flattened(truth.instance)] == np.array([*names, ""])[face]).all()
    seen = face >= 0
    assert 0.3 < seen.mean() < 0.99
    np.testing.assert_allclose(flattened(truth.depth)[seen], (distance_m * rays[:, 2])[seen], rtol=2e-7)
    normals = faces.plane[face[seen]] @ pose[:3, :3]
    np.testing.assert_allclose(flattened(truth.normals)[seen], normals, atol=1e-6)


def tessellated(corner_m, edge_u_m, edge_v_m, count: int) -> Trimesh:
    """A rectangle of count * count squares, each of two faces with corners of its own."""
    u, v = np.asarray(edge_u_m, float) / count, np.asarray(edge_v_m, float) / count
    places = np.ndindex(count, count)
    return joined([quad(np.asarray(corner_m) + i * u + j * v, u, v) for i, j in places])


def test_rays_through_corners_and_edges_of_faces_meet_one_of_them():
    # Every pixel's ray goes through a corner of the wall's squares, 5 m away: 1/20 m a pixel.
    wall = flipped(tessellated([5.0, -1.5, -1.0], [0, 3.0, 0], [0, 0, 2.0], 20))
    camera, pose = Pinhole(21, 21, 100.0 / 3, 50.0, 10.0, 10.0), looking(pitch_deg=0, position_m=(0, 0, 0))
    caster = TruthCaster(Scene("wall", (Thing("wall", wall, "diffuse"),), MATERIALS, ()))
    truth = caster.frame(camera, CameraShot(pose, 0), ["depth", "instance"])
    inner = slice(1, -1), slice(1, -1)
    np.testing.assert_allclose(truth.depth[inner], 5.0, rtol=1e-7)
    assert (truth.instance[inner] == 1).all()


@pytest.mark.parametrize("seed", range(4))
def test_every_ray_inside_a_closed_room_ends(seed):
    rng = np.random.default_rng(seed)
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T = se3.transform(turned * np.linalg.det(turned), rng.uniform(-40, 40, 3))
    inside = moved(joined([flipped(side) for side in sides([0, 0, 1.5], rng.uniform(3, 12, 3))]), T)
    caster = TruthCaster(Scene("room", (Thing("room", inside, "diffuse"),), MATERIALS, ()))
    shot = CameraShot(T @ se3.transform(np.eye(3), [0.1, -0.3, 1.6]), 0)
    truth = caster.frame(Equirectangular(720, 360), shot, ["depth", "normals", "instance"])
    assert np.isfinite(truth.depth).all()
    assert np.isfinite(truth.normals).all()
    assert (truth.instance == 1).all()


def test_the_back_of_a_sheet_of_two_sides_is_seen_as_its_front_is():
    both = Thing("card", two_sided(quad([2.0, -0.5, -0.5], [0, 1.0, 0], [0, 0, 1.0])), "diffuse")
    caster = TruthCaster(Scene("card", (both,), MATERIALS, ()))
    camera = CAMERAS["pinhole"]
    ahead = looking(pitch_deg=0, position_m=(0, 0, 0))
    behind = se3.transform(se3.rotation_z(np.pi), [4.0, 0, 0]) @ ahead
    for pose in (ahead, behind):
        truth = caster.frame(camera, CameraShot(pose, 0), ["depth", "normals"])
        seen = np.isfinite(truth.depth)
        assert 0.13 < seen.mean() < 0.16
        np.testing.assert_allclose(truth.depth[seen], 2.0, rtol=1e-6)
        np.testing.assert_allclose(truth.normals[seen], [[0, 0, -1.0]] * seen.sum(), atol=1e-6)


def holed(opacity) -> dict[str, Material]:
    """Paper whose picture of 4 × 4 pixels, 0.4 m wide, is solid where `opacity` is 255."""
    pixels = np.full((4, 4, 4), 200, np.uint8)
    pixels[..., 3] = opacity
    return {**MATERIALS, "paper": Material(texture=Picture(pixels, 0.4), cutout=0.5)}


def test_what_is_seen_through_holes_is_what_is_behind_and_light_falls_through():
    # Left half solid: opacity rises from a hole to solid over a pixel, half way at its edge.
    opacity = np.where(np.arange(4) < 2, 255, 0)[None]
    sheet_m = two_sided(quad([-0.4, -0.4, 0.5], [0.8, 0, 0], [0, 0.8, 0]))
    floor = sheet("floor", np.zeros(3), [4.0, 0, 0], [0, 4.0, 0])
    bulb = PointLight("bulb", np.array([0.0, 0, 1.0]), 100.0)
    still = Scene("holes", (floor, Thing("paper", sheet_m, "paper")), holed(opacity), (bulb,))
    path = WaypointMotion(np.array([0.0]), np.zeros((1, 3)), np.zeros(1))
    moving = replace(still, things=(floor,), movers=(Mover("paper", still.things[1:], path),))
    place_m = (np.arange(201) - 100) / 100
    x, y = np.meshgrid(place_m, -place_m)
    stripe = (x * 0.75 + 0.4) % 0.4 / 0.4  # the paper is 1.5 m below the camera, the floor 2 m
    on_paper = np.maximum(np.abs(x), np.abs(y)) * 0.75 < 0.4 - 1e-3
    off_edge = np.abs((stripe * 2) % 1 - 0.5) < 0.49
    for scene in (still, moving):
        caster = TruthCaster(scene)
        truth = caster.frame(TOP, CameraShot(ABOVE, 0), ["instance", "depth", "shadow"])
        paper = caster.names.instance.index("paper")
        assert ((truth.instance == paper) == (stripe < 0.5))[on_paper & off_edge].all()
        through = on_paper & off_edge & (stripe > 0.5)
        np.testing.assert_allclose(truth.depth[through], 2.0, rtol=1e-6)
        # The bulb, half a metre above the paper, throws its stripes on the floor twice as wide.
        dark = ((x / 2 + 0.4) % 0.4 / 0.4 < 0.5) & (np.abs(x / 2) < 0.4) & (np.abs(y / 2) < 0.4)
        clear = (np.abs(((x / 2 + 0.4) % 0.4 / 0.2) % 1 - 0.5) < 0.45) & (np.abs(np.abs(x / 2) - 0.4) > 0.01)
        assert (truth.shadow > 0)[through & clear & dark].all()
        assert not truth.shadow[through & clear & ~dark].any()


def test_a_lamp_with_faces_to_all_sides_shines_to_all_sides_and_is_not_in_its_own_way():
    center_m, rng = np.array([1.0, 2.0, 3.0]), np.random.default_rng(0)
    points_m = (center_m + 2 * unit(rng.normal(size=(50, 3)))).astype(np.float32)
    ball, panel = (
        lamp_of(mesh.triangles) for mesh in (icosphere(center_m, 0.5, splits=1), sides(center_m, (1, 1, 0))[4])
    )
    for lamp, stops_m, half in ((ball, 1.5, False), (panel, 2.0, True)):
        vectors_m = lamp.vectors_m(points_m)
        np.testing.assert_allclose(lamp.center_m, center_m, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(vectors_m, axis=1), stops_m, rtol=1e-5)
        assert (np.broadcast_to(lamp.shines(vectors_m), 50) == (points_m[:, 2] > 3 if half else True)).all()


def test_things_far_from_the_origin_throw_no_shadow_on_themselves():
    floor = sheet("floor", [300.0, -200.0, 0], [40.0, 0, 0], [0, 40.0, 0])
    ball = Thing("ball", icosphere([300.0, -200.0, 1.0], 1.0, splits=3), "diffuse")
    sun = Sun("sun", 1e5, (0.0,), (0.0,), (60.0,))
    caster = TruthCaster(Scene("far", (floor, ball), MATERIALS, (sun,)))
    above = se3.transform(np.diag([1.0, -1.0, -1.0]), [300.0, -200.0, 8.0])
    truth = caster.frame(Pinhole(201, 201, 200.0, 200.0, 100.0, 100.0), CameraShot(above, 0), ["instance", "shadow"])
    on_ball = truth.instance == caster.names.instance.index("ball")
    assert 0.01 < (truth.shadow[~on_ball] > 0).mean() < 0.2
    assert not truth.shadow[on_ball].any()
