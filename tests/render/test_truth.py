"""Ground truth agrees with geometry worked out apart from it: no Embree, no tiles, float64, one plane at a time."""

from dataclasses import replace

import numpy as np
import pytest

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
from vobench.render.geometry import inventory
from vobench.render.truth import Shot, TruthCaster
from vobench.scene.light import PointLight, Sky, SpotLight, Sun, Switched
from vobench.scene.material import Glass, Matt, Mirror, Polished
from vobench.scene.scene import Mover, Path, Scene, ceiling_light
from vobench.scene.surface import Surface, box, rectangle, room
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame

PLAIN = ("plain", 0.5, 0.0, 1.0, 8, 0)
MATERIALS = {
    "matt": Matt(*PLAIN),
    "wax": Polished(*PLAIN),
    "steel": Mirror(),
    "glass": Glass(),
}
SECOND_NS = 1_000_000_000
RIDE = Path(np.array([0.0, 2.0]), np.array([[1.5, -1.2, 0.3], [1.9, 1.0, 0.3]]), np.array([0.0, 50.0]))
CART = Mover("cart", tuple(box(np.zeros(3), (0.5, 0.4, 0.6), yaw_deg=0, material="matt", instance="x")), RIDE)
HALL = Scene(
    "hall",
    (
        *room((8, 6, 3), floor="wax", wall="matt", ceiling="matt"),
        *box(np.array([2.0, 0.9, 0.4]), (0.8, 0.6, 0.8), yaw_deg=30, material="matt", instance="crate"),
        *box(np.array([-2.0, -1.5, 0.7]), (0.3, 1.6, 1.4), yaw_deg=-12, material="matt", instance="shelf"),
        rectangle(np.array([3.99, -1.0, 1.2]), np.array([0, 0, 1.0]), np.array([0, 1.5, 0]), "steel", "mirror"),
        rectangle(np.array([1.0, 0.4, 0.8]), np.array([0, 0.6, 0]), np.array([0, 0, 0.5]), "glass", "pane"),
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
NOW, LATER = Shot(HERE, 0), Shot(NEXT, STEP_NS)


def nearest(scene: Scene, origin_m: Array, directions: Array, *, t_ns: float) -> tuple[Array, Array]:
    """The first opaque front along each direction (R, 3): surface, -1 for none, and lengths, infinite for none."""
    listed, best = inventory(scene, t_ns=t_ns), np.full(len(directions), np.inf)
    which = np.full(len(directions), -1)
    for index, surface in enumerate(listed.surfaces):
        along = directions @ surface.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (surface.corner_m - origin_m) @ surface.normal / along
            local = origin_m + distance[:, None] * directions - surface.corner_m
        u, v = (local @ edge / (edge @ edge) for edge in (surface.edge_u_m, surface.edge_v_m))
        hit = (along < 0) & (distance > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1) & (distance < best)
        if not listed.pane[index]:
            best[hit], which[hit] = distance[hit], index
    return which, best


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
    """Surfaces (R,), distances (R,) and rays (R, 3), by planes."""
    rays = camera.rays(pixel_grid(camera)).reshape(-1, 3)
    return *nearest(HALL, HERE[:3, 3], rays @ HERE[:3, :3].T, t_ns=0), rays


def flat(channel: np.ndarray | None) -> np.ndarray:
    assert channel is not None
    return channel.reshape(-1, *channel.shape[2:])


def off_edges(same: np.ndarray) -> np.ndarray:
    """All but a few: rays that graze an edge may fall on either side of it."""
    assert same.mean() > 0.9995
    return same


def test_every_camera_has_depth_to_1e_6_where_planes_put_it(truth, expected, camera):
    surface, distance_m, rays = expected
    depth = flat(truth.depth)
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
    floor = rectangle(np.zeros(3), np.array([60.0, 0, 0]), np.array([0, 60.0, 0]), "matt", "floor")
    camera, pose = LENSES["paper_literal"], looking(pitch_deg=15, position_m=(0, 0, 0.4))
    depth = TruthCaster(Scene("plain", (floor,), MATERIALS, ())).frame(camera, Shot(pose, 0), ["depth"]).depth
    assert depth is not None
    rays = camera.rays(pixel_grid(camera))
    exact = rays[..., 2] * -0.4 / (rays @ pose[:3, :3].T)[..., 2]
    near = (exact > 0) & (exact < 20)
    assert exact[near].max() > 19
    assert np.abs(depth[near] / exact[near] - 1).max() < 1e-6
    assert np.isnan(depth[exact < 0]).all()


def test_normals_are_those_of_the_surfaces_in_the_cameras_frame(truth, expected):
    surface = expected[0]
    normals = np.array([s.normal for s in inventory(HALL, t_ns=0).surfaces]) @ HERE[:3, :3]
    seen = surface >= 0
    error = np.abs(flat(truth.normals)[seen] - normals[surface[seen]]).max(1)
    off_edges(error < 1e-6)


def test_ids_name_what_is_seen_and_movers_by_their_own_name(truth, expected, caster):
    surface, listed = expected[0], inventory(HALL, t_ns=0)
    things = ["cart" if listed.mover[i] >= 0 else s.instance for i, s in enumerate(listed.surfaces)]
    instance = np.array(caster.names.instance)[flat(truth.instance)]
    material = np.array(caster.names.material)[flat(truth.material)]
    off_edges(instance == np.array([*things, ""])[surface])
    off_edges(material == np.array([*(s.material for s in listed.surfaces), ""])[surface])
    off_edges(flat(truth.moving) == (np.append(listed.mover, -1)[surface] >= 0))
    assert {"cart", "crate", "floor", "wall_east"} <= set(instance)
    assert caster.names.instance[0] == caster.names.material[0] == ""


def test_mirrors_coats_and_what_stands_behind_panes_are_in_the_mask(truth, expected):
    surface, distance_m, rays = expected
    listed = inventory(HALL, t_ns=0)
    shiny = np.array([*(s.material in {"wax", "steel"} for s in listed.surfaces), False])[surface]
    pane = HALL.surfaces[-1]
    directions = rays @ HERE[:3, :3].T
    with np.errstate(invalid="ignore"):
        reach = (pane.corner_m - HERE[:3, 3]) @ pane.normal / (directions @ pane.normal)
        local = HERE[:3, 3] + reach[:, None] * directions - pane.corner_m
        u, v = (local @ edge / (edge @ edge) for edge in (pane.edge_u_m, pane.edge_v_m))
        behind = (reach > 0) & (reach < distance_m) & (u > 0) & (u < 1) & (v > 0) & (v < 1)
    assert behind.any()
    off_edges(flat(truth.mirror) == (shiny | behind))


def carried(expected: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """The seen points (R, 3) in the next camera's frame, and in the world then."""
    surface, distance_m, rays = expected
    points_m = HERE[:3, 3] + distance_m[:, None] * (rays @ HERE[:3, :3].T)
    onward = RIDE.pose(STEP_NS) @ se3.inverse(RIDE.pose(0))
    moving = np.append(inventory(HALL).mover, -1)[surface] >= 0
    with np.errstate(invalid="ignore"):
        world_m = np.where(moving[:, None], se3.apply(onward, points_m), points_m)
        return se3.apply(se3.inverse(NEXT), world_m), world_m


@pytest.mark.filterwarnings("ignore:invalid value encountered")
def test_flow_is_reprojection_of_what_stands_and_of_what_moves(truth, expected, camera):
    seen = expected[0] >= 0
    uv_px = camera.project(carried(expected)[0])
    flow = uv_px - pixel_grid(camera).reshape(-1, 2)
    error = np.abs(flat(truth.flow) - flow).max(1)[seen]
    known = np.isfinite(uv_px).all(1)[seen]
    assert np.isnan(error[~known]).all()
    off_edges(error[known] < 1e-3)
    assert np.isnan(flat(truth.flow)[~seen]).all()


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
    off_edges(flat(truth.occlusion) == (seen & (outside | hidden)))


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


def rolling(count: int) -> tuple[Shot, Shot]:
    """A camera that turns and walks while its rows are exposed, and the picture after it."""
    t_ns = np.arange(count) * 60_000_000 // count

    def at(t: Array) -> Array:
        turned, walked = se3.rotation_z(1.5 * t), np.stack([0.8 * t, 0.3 * t, 0 * t], -1)
        return se3.transform(turned, walked) @ HERE

    return Shot(at(t_ns / SECOND_NS), t_ns), Shot(at((t_ns + STEP_NS) / SECOND_NS), t_ns + STEP_NS)


def test_each_row_of_a_rolling_shutter_is_that_of_a_still_camera_at_its_instant(caster):
    camera = CAMERAS["pinhole"]
    now, later = rolling(camera.height_px)
    whole = caster.frame(camera, now, later=later)
    for row in (0, 1, 60, camera.height_px - 1):
        still = caster.frame(camera, Shot(now.T_world_camera[row], now.t_ns[row]))
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
    floor = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "matt", "floor")
    return TruthCaster(Scene("stage", (floor, *things), MATERIALS, lights, movers))


ABOVE = se3.transform(np.diag([1.0, -1.0, -1.0]), [0, 0, 2.0])
TOP = Pinhole(201, 201, 200.0, 200.0, 100.0, 100.0)  # column c sees x = (c - 100) / 100 m


def shadow(caster: TruthCaster, *, t_ns: int = 0) -> np.ndarray:
    found = caster.frame(TOP, Shot(ABOVE, t_ns), ["shadow"]).shadow
    assert found is not None
    return found


def plate(*, material: str = "matt", x_m: float = 0.0) -> Surface:
    """0.2 m square, half a metre above the floor, seen from below and so not from the camera above."""
    return rectangle(np.array([x_m, 0, 0.5]), np.array([0, 0.2, 0]), np.array([0.2, 0, 0]), material, "plate")


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
    path = Path(np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [0.4, 0, 0]]), np.zeros(2))
    bulb = PointLight("bulb", np.array([0.0, 0, 1.0]), 100.0)
    caster = stage(bulb, movers=(Mover("kite", (plate(),), path),))
    for t_ns, x_m in ((0, 0.0), (SECOND_NS, 0.8)):
        found, beside = shadow(caster, t_ns=t_ns), square(0.2, x_m=x_m)
        assert (found[beside < -0.003] == 1).all()
        assert (found[beside > 0.003] == 0).all()


def test_shadows_in_a_room_are_those_of_rays_without_tiles(caster, monkeypatch):
    camera, shot = LENSES["paper_literal"], Shot(HERE, 0)
    by_tiles = caster.frame(camera, shot, later=LATER)
    monkeypatch.setattr(
        "vobench.render.occlusion.PointView.fills", lambda self, axis, sine: np.full(len(axis), -1, np.int32)
    )
    by_rays = TruthCaster(HALL).frame(camera, shot, later=LATER)
    for name, values in by_rays.channels().items():
        if values.dtype == np.float32:
            np.testing.assert_allclose(values, by_tiles.channels()[name], rtol=1e-5, atol=1e-5, err_msg=name)
        else:
            assert (values != by_tiles.channels()[name]).mean() < 1e-5, name


def test_threads_do_not_change_a_bit(caster):
    camera = LENSES["paper_literal"]
    first, second = (caster.frame(camera, NOW, later=LATER).channels() for _ in range(2))
    for name in first:
        assert first[name].tobytes() == second[name].tobytes()


def test_backs_are_not_seen_but_hide_lights():
    ceiling = rectangle(np.array([0, 0, 1.5]), np.array([0, 1.0, 0]), np.array([1.0, 0, 0]), "matt", "ceiling")
    caster = stage(PointLight("bulb", np.array([0, 0, 3.0]), 100.0), things=(ceiling,))
    truth = caster.frame(TOP, Shot(ABOVE, 0), ["depth", "shadow"])
    assert ceiling.normal[2] < 0
    np.testing.assert_allclose(truth.depth, 2.0, rtol=1e-6)
    assert truth.shadow[100, 100] == 1
