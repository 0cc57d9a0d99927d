"""What a scene's YAML may say becomes lights, materials and levels of the same values."""

import numpy as np
import pytest

from vobench.errors import SettingError
from vobench.scene.light import Dimmer, Flicker, Steady
from vobench.scene.material import LUMINANCE
from vobench.suite.scene_spec import (
    BoardSpec,
    BoxSpec,
    DiffuseSpec,
    FurnitureSpec,
    GlassSpec,
    LevelSpec,
    LuminousSpec,
    MirrorSpec,
    ModelSpec,
    MoverSpec,
    PanelLamp,
    PathKey,
    PointLamp,
    PolishedSpec,
    RoomSpec,
    SceneFile,
    SkySpec,
    SpotLamp,
    SunKey,
    SunSpec,
    WindowSpec,
    unit_luminance_colour,
)

KEYS = (PathKey(t_s=0.0, position_m=(0.0, 0.0, 0.0)), PathKey(t_s=1.0, position_m=(1.0, 0.0, 0.0)))


@pytest.mark.parametrize("steady", [0.0, 0.5, 1.0, 2.0])
def test_a_steady_level_is_itself_even_if_it_is_0(steady):
    level = LevelSpec(steady=steady).build()
    assert isinstance(level, Steady)
    assert level.mean(0, 10**9) == steady


def test_a_dimmer_has_its_levels_at_its_times():
    level = LevelSpec(dimmer=((0.0, 1.0), (2.0, 0.0))).build()
    assert isinstance(level, Dimmer)
    assert level.mean(0, 0) == 1
    assert level.mean(10**9, 10**9) == pytest.approx(0.5)


def test_a_level_has_exactly_one_form():
    for fields in ({}, {"steady": 1.0, "flicker": Flicker(depth=0.5)}):
        with pytest.raises(SettingError, match="exactly one of steady, flicker, dimmer, switched"):
            LevelSpec(**fields)
    with pytest.raises(SettingError, match="times should increase"):
        LevelSpec(dimmer=((1.0, 1.0), (1.0, 0.0)))


@pytest.mark.parametrize("colour", [(1.0, 1.0, 1.0), (1.0, 0.0, 0.0), (0.2, 0.4, 0.1)])
def test_a_hue_has_luminance_1_and_the_ratios_of_its_colour(colour):
    scaled = unit_luminance_colour(colour)
    assert np.dot(scaled, LUMINANCE) == pytest.approx(1)
    np.testing.assert_allclose(np.cross(scaled, colour), 0, atol=1e-12)


def test_black_light_is_refused():
    with pytest.raises(SettingError, match="light should not be black"):
        unit_luminance_colour((0.0, 0.0, 0.0))


def test_a_luminous_material_has_its_luminance_in_any_hue():
    for colour in ((1.0, 1.0, 1.0), (1.0, 0.5, 0.0)):
        emission = LuminousSpec(luminance_cd_m2=80.0, colour=colour).build().emission_cd_m2
        assert np.dot(emission, LUMINANCE) == pytest.approx(80)


def test_mirrors_and_panes_have_their_tint():
    assert (MirrorSpec(tint=0.7).build().kind, MirrorSpec(tint=0.7).build().tint) == ("mirror", 0.7)
    pane = GlassSpec(eta=1.4, tint=0.6).build()
    assert (pane.kind, pane.eta, pane.tint) == ("pane", 1.4, 0.6)


def test_lamps_have_their_power_and_place():
    panel = PanelLamp(name="a", center_m=(1.0, 2.0, 3.0), size_m=(0.5, 0.4), power_lm=300.0).build()
    assert panel.power_lm == pytest.approx(300)
    bulb = PointLamp(name="b", center_m=(1.0, 2.0, 3.0), power_lm=200.0).build()
    assert bulb.power_lm == 200
    spot = SpotLamp(name="c", center_m=(0.0, 0.0, 3.0), target_m=(0.0, 4.0, 0.0), power_lm=100.0).build()
    np.testing.assert_allclose(spot.direction, [0, 0.8, -0.6])
    assert (spot.inner_deg, spot.outer_deg) == (20, 30)


@pytest.mark.parametrize(("inner_deg", "is_right"), [(29.9, True), (30.0, True), (30.1, False)])
def test_the_inner_angle_of_a_spot_is_at_most_the_outer_one(inner_deg, is_right):
    fields = {"name": "c", "center_m": (0.0, 0.0, 3.0), "target_m": (0.0, 0.0, 0.0), "power_lm": 1.0}
    if is_right:
        assert SpotLamp(inner_deg=inner_deg, **fields).inner_deg == inner_deg
    else:
        with pytest.raises(SettingError, match=r"inner_deg: should be at most outer_deg, 30 \(got 30.1\)"):
            SpotLamp(inner_deg=inner_deg, **fields)


@pytest.mark.parametrize(
    ("point_m", "is_inside"),
    [
        ((0, 0, 1), True),
        ((1.99, 0.99, 0.01), True),
        ((2.0, 0, 1), False),
        ((-2.01, 0, 1), False),
        ((0, 1.0, 1), False),
        ((0, 0, 0), False),
        ((0, 0, 2.99), True),
        ((0, 0, 3), False),
    ],
)
def test_a_room_holds_what_is_within_its_walls_floor_and_ceiling(point_m, is_inside):
    room = RoomSpec(size_m=(4.0, 2.0, 3.0), floor="a", wall="a", ceiling="a")
    assert room.holds(point_m) == is_inside
    np.testing.assert_array_equal(room.holds([point_m, point_m]), [is_inside] * 2)


def test_the_extent_of_a_room_names_its_sides():
    assert (
        RoomSpec(size_m=(4.0, 2.5, 3.0), floor="a", wall="a", ceiling="a").extent == "4 × 2.5 × 3 m around the origin"
    )


@pytest.mark.parametrize(
    ("fields", "is_right"),
    [
        ({"azimuth_deg": 0.0, "elevation_deg": 30.0}, True),
        ({"path": (SunKey(t_s=0.0, azimuth_deg=0.0, elevation_deg=30.0),)}, True),
        ({"azimuth_deg": 0.0}, False),
        ({"elevation_deg": 30.0}, False),
        ({}, False),
        ({"azimuth_deg": 0.0, "path": (SunKey(t_s=0.0, azimuth_deg=0.0, elevation_deg=30.0),)}, False),
    ],
)
def test_a_sun_has_two_angles_or_a_path(fields, is_right):
    if is_right:
        SunSpec(illuminance_lx=1.0, **fields)
    else:
        with pytest.raises(SettingError, match="either azimuth_deg and elevation_deg, or a path"):
            SunSpec(illuminance_lx=1.0, **fields)


BOX = {"size_m": (1.0, 1.0, 1.0), "material": "oak"}


@pytest.mark.parametrize(
    ("fields", "is_right"),
    [
        (BOX, True),
        ({"kind": "person"}, True),
        ({"file": "cart.glb"}, True),
        ({}, False),
        ({"size_m": (1.0, 1.0, 1.0)}, False),
        ({"material": "oak"}, False),
        ({**BOX, "kind": "person"}, False),
        ({"kind": "person", "file": "cart.glb"}, False),
        ({"kind": "person", "material": "oak"}, False),
    ],
)
def test_a_mover_is_a_box_or_furniture_or_a_model(fields, is_right):
    if is_right:
        MoverSpec(name="a", path=KEYS, **fields)
    else:
        with pytest.raises(SettingError):
            MoverSpec(name="a", path=KEYS, **fields)


def test_the_keys_of_a_mover_are_in_order_of_time():
    with pytest.raises(SettingError, match="times should increase"):
        MoverSpec(name="a", path=KEYS[::-1], kind="person")


def test_a_scene_needs_something_visible():
    with pytest.raises(SettingError, match="a scene needs something visible"):
        SceneFile(name="a", white_cd_m2=1.0)
    assert SceneFile(name="a", white_cd_m2=1.0, maker="a.py").seed == 0


def test_what_is_left_out_changes_nothing():
    model = ModelSpec(file="a.glb")
    assert (model.at_m, model.yaw_deg, model.scale, model.up, model.roles) == ((0, 0, 0), 0, 1, None, {})
    desk = FurnitureSpec(kind="table", name="desk", at_m=(1.0, 0.0, 0.0))
    assert (desk.yaw_deg, desk.pitch_deg, desk.size) == (0, 0, {})
    box = BoxSpec(center_m=(0.0, 0.0, 1.0), size_m=(1.0, 1.0, 1.0), material="oak")
    assert (box.yaw_deg, box.name) == (0, None)
    assert BoardSpec(center_m=(0.0, 0.0, 1.0), size_m=(1.0, 1.0), material="oak").yaw_deg == 0
    assert (KEYS[0].yaw_deg, MoverSpec(name="a", path=KEYS, kind="person").repeats) == (0, False)
    scene = SceneFile(name="a", white_cd_m2=1.0, maker="a.py")
    assert (scene.seed, scene.scale, scene.lamps, scene.materials) == (0, 1, (), {})
    assert (SkySpec(illuminance_lx=1.0).kind, PointLamp(name="b", center_m=(0.0, 0.0, 1.0), power_lm=1.0).level) == (
        "overcast",
        LevelSpec(steady=1.0),
    )
    window = WindowSpec(wall="north", center_m=(0.0, 1.0), size_m=(1.0, 1.0), pane="p", reveal="r")
    assert window.depth_m == 0.15


def test_materials_have_usual_values_if_nothing_is_said():
    assert (MirrorSpec().tint, MirrorSpec().roughness) == (0.9, 0)
    assert (GlassSpec().eta, GlassSpec().tint) == (1.5, 1)
    polished = PolishedSpec(pattern="plain", albedo=0.5)
    assert (polished.eta, polished.tint, polished.roughness, polished.colour) == (1.5, 1, 0, (1, 1, 1))
    assert DiffuseSpec(pattern="plain", albedo=0.5).build().is_coated is False
    assert polished.build().is_coated is True


@pytest.mark.parametrize(
    ("build", "bound"),
    [
        (lambda value: GlassSpec(eta=value), (1.0, 4.0)),
        (lambda value: MirrorSpec(roughness=value), (0.0, 0.5)),
        (lambda value: MirrorSpec(tint=value), (0.0, 1.0)),
        (lambda value: SceneFile(name="a", white_cd_m2=1.0, maker="a.py", scale=value), (0.05, 20.0)),
    ],
)
def test_values_within_their_bounds_are_taken_and_others_refused(build, bound):
    least, most = bound
    build(least)
    build(most)
    for value in (least - 0.01, most + 0.01):
        with pytest.raises(SettingError, match="should be "):
            build(value)


@pytest.mark.parametrize(
    ("elevation_deg", "is_up"), [(-1.0, False), (0.0, False), (0.1, True), (90.0, True), (90.1, False)]
)
def test_a_sun_is_above_the_horizon_however_little(elevation_deg, is_up):
    values = {"illuminance_lx": 1000.0, "azimuth_deg": 0.0, "elevation_deg": elevation_deg}
    if is_up:
        assert SunSpec(**values).elevation_deg == elevation_deg
    else:
        with pytest.raises(SettingError, match="elevation_deg"):
            SunSpec(**values)
