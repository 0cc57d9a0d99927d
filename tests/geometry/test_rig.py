"""The true rig differs from the nominal one by exactly what was declared."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.errors import InputError, SettingError, VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, Equirectangular, Pinhole
from vobench.geometry.rig import (
    LENSES,
    PIONEER_WHEELS,
    PRESETS,
    RESIDUALS,
    SPREAD,
    CalibrationError,
    CameraError,
    CustomStereoPair,
    Lens,
    Rig,
    StereoPreset,
    custom_stereo_pair,
    drawn_calibration_error,
    lens_of,
    looking,
    mounted_rig,
    paper_lens,
    projection,
    rectification,
    resized,
    stereo_rig,
    true_camera,
    true_rig,
)

RIGS = {name: mounted_rig(p.left, p.right, p.T_left_right, pitch_deg=12.3) for name, p in PRESETS.items()}
EUROC = RIGS["euroc"]

every_rig = pytest.mark.parametrize("rig", RIGS.values(), ids=list(RIGS))


def turned_deg(true: Rig, nominal: Rig) -> np.ndarray:
    """Turn of the right camera (3,) about its own x, y, z."""
    R = nominal.T_body_right[:3, :3].T @ true.T_body_right[:3, :3]
    return Rotation.from_matrix(R).as_rotvec(degrees=True)


@every_rig
def test_no_error_changes_no_bit(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError())
    assert (true.left, true.right, true.wheels) == (rig.left, rig.right, rig.wheels)
    assert true.T_body_left.tobytes() == rig.T_body_left.tobytes()
    assert true.T_body_right.tobytes() == rig.T_body_right.tobytes()


@every_rig
def test_a_focal_error_magnifies_the_picture_about_its_centre(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError(focal_ratio=0.01))
    points = np.random.default_rng(1).uniform([-0.3, -0.3, 1], [0.3, 0.3, 3], (50, 3))
    for nominal, camera in ((rig.left, true.left), (rig.right, true.right)):
        centre = nominal.K[:2, 2]
        grown = 1.01 * (nominal.project(points) - centre)
        np.testing.assert_allclose(camera.project(points) - centre, grown, atol=1e-9)


@every_rig
def test_a_centre_error_shifts_the_whole_picture(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError(center_px=(1.5, -0.5)))
    points = np.random.default_rng(2).uniform([-0.3, -0.3, 1], [0.3, 0.3, 3], (50, 3))
    for nominal, camera in ((rig.left, true.left), (rig.right, true.right)):
        shift = camera.project(points) - nominal.project(points)
        np.testing.assert_allclose(shift, np.broadcast_to([1.5, -0.5], shift.shape), atol=1e-9)


def test_a_distortion_error_is_a_share_of_every_coefficient() -> None:
    true = true_rig(EUROC, CalibrationError(distortion_ratio=-0.1))
    assert true.left.k1 == pytest.approx(0.9 * EUROC.left.k1, rel=1e-15)
    assert true.right.p2 == pytest.approx(0.9 * EUROC.right.p2, rel=1e-15)
    assert true.left.fx_px == EUROC.left.fx_px


@every_rig
def test_a_baseline_error_is_a_share_of_the_baseline_and_moves_the_right_camera_along_it(rig: Rig) -> None:
    true = true_rig(rig, CalibrationError(baseline_ratio=0.05))
    assert true.baseline_m == pytest.approx(1.05 * rig.baseline_m, rel=1e-12)
    np.testing.assert_allclose(np.cross(true.T_left_right[:3, 3], rig.T_left_right[:3, 3]), 0, atol=1e-15)
    np.testing.assert_array_equal(true.T_body_left, rig.T_body_left)
    np.testing.assert_allclose(turned_deg(true, rig), 0, atol=1e-12)


@every_rig
@pytest.mark.parametrize(("name", "axis"), [("right_pitch_deg", 0), ("right_yaw_deg", 1), ("right_roll_deg", 2)])
def test_a_turn_is_of_the_right_camera_about_one_of_its_own_axes(rig: Rig, name: str, axis: int) -> None:
    true = true_rig(rig, CalibrationError(**{name: 0.7}))
    np.testing.assert_allclose(turned_deg(true, rig), 0.7 * np.eye(3)[axis], atol=1e-9)
    np.testing.assert_array_equal(true.T_body_right[:3, 3], rig.T_body_right[:3, 3])
    np.testing.assert_array_equal(true.T_body_left, rig.T_body_left)


def test_turns_are_named_as_a_person_sees_them() -> None:
    rig = stereo_rig(EUROC.left, pitch_deg=0)
    forward = {
        name: true_rig(rig, CalibrationError(**{f"right_{name}_deg": 1.0})).T_body_right[:3, :3]
        for name in ("pitch", "yaw", "roll")
    }
    assert forward["pitch"][2, 2] > 0, "looks up"
    assert forward["yaw"][1, 2] < 0, "looks right, and y is left"
    assert forward["roll"][2, 0] < 0, "its right side sinks"


def test_all_turns_together_stay_a_rotation() -> None:
    true = true_rig(EUROC, CalibrationError(right_roll_deg=2, right_pitch_deg=-3, right_yaw_deg=4, baseline_ratio=0.1))
    assert se3.is_rotation(true.T_body_right[:3, :3], tolerance=1e-12)
    assert 4 < np.linalg.norm(turned_deg(true, EUROC)) < 9


def test_an_eyes_own_error_is_added_to_that_of_both_and_is_of_no_other_eye() -> None:
    both = true_rig(EUROC, CalibrationError(focal_ratio=0.01, right_yaw_deg=0.2))
    own = CameraError(focal_ratio=0.01, center_px=(1.0, 2.0), yaw_deg=-0.2)
    right = true_rig(EUROC, CalibrationError(focal_ratio=0.01, right_yaw_deg=0.2, right=own))
    assert right.left == both.left
    assert right.right.fx_px == pytest.approx(EUROC.right.fx_px * 1.02)
    np.testing.assert_allclose(turned_deg(right, EUROC), 0, atol=1e-12)
    left = true_rig(EUROC, CalibrationError(left=CameraError(roll_deg=0.3)))
    turn = Rotation.from_matrix(EUROC.T_body_left[:3, :3].T @ left.T_body_left[:3, :3])
    np.testing.assert_allclose(turn.as_rotvec(degrees=True), [0, 0, 0.3], atol=1e-12)
    np.testing.assert_array_equal(left.T_body_right, EUROC.T_body_right)


def test_tangential_terms_are_added_and_make_a_pinhole_a_brown_conrady_lens() -> None:
    error = CameraError(tangential=(0.002, -0.004), center_px=(1.0, 0.0))
    true = true_camera(EUROC.right, error)
    assert true.p1 - EUROC.right.p1 == pytest.approx(0.002)
    assert true.p2 - EUROC.right.p2 == pytest.approx(-0.004)
    pinhole = Pinhole(640, 480, 400.0, 410.0, 319.5, 239.5)
    lens = true_camera(pinhole, error)
    assert isinstance(lens, BrownConrady)
    x, y = 0.5, -0.3
    moved_px = lens.project([x, y, 1.0]) - pinhole.project([x, y, 1.0])
    r_squared = x * x + y * y
    along_x = 2 * 0.002 * x * y - 0.004 * (r_squared + 2 * x * x)
    along_y = 0.002 * (r_squared + 2 * y * y) - 2 * 0.004 * x * y
    np.testing.assert_allclose(moved_px, [400 * along_x + 1, 410 * along_y], atol=1e-9)
    fisheye = PRESETS["fisheye"].right
    with pytest.raises(VobenchError, match=r"^tangential needs a pinhole or a lens of model brown_conrady, got Kann"):
        true_camera(fisheye, error)


@every_rig
def test_a_pair_that_is_written_into_a_suite_comes_back(rig: Rig) -> None:
    preset = custom_stereo_pair(rig).preset()
    assert (preset.left, preset.right) == (rig.left, rig.camera("right"))
    np.testing.assert_allclose(preset.T_left_right, rig.T_left_right, atol=1e-12)


def test_what_is_given_besides_a_level_is_added_to_what_the_level_stands_for() -> None:
    given = CalibrationError(center_px=(20.0, -7.0), focal_ratio=0.1, baseline_ratio=0.2, distortion_ratio=0.3)
    alone, both = (
        drawn_calibration_error(error, EUROC, np.random.default_rng(3))
        for error in (CalibrationError(level="worn"), replace(given, level="worn"))
    )
    np.testing.assert_allclose(np.subtract(both.center_px, alone.center_px), given.center_px)
    for name in ("focal_ratio", "baseline_ratio", "distortion_ratio"):
        assert getattr(both, name) - getattr(alone, name) == pytest.approx(getattr(given, name))


@pytest.mark.parametrize("level", RESIDUALS)
@every_rig
def test_a_drawn_calibration_is_off_by_its_levels_pixels_whatever_the_focal_length(rig: Rig, level: str) -> None:
    usual, found = RESIDUALS[level], []
    for seed in range(20):
        error = drawn_calibration_error(CalibrationError(level=level), rig, np.random.default_rng(seed))
        assert drawn_calibration_error(error, rig, np.random.default_rng(seed)) is error
        true_rig(rig, error)
        turns = np.tan(np.deg2rad([error.right_yaw_deg, error.right_pitch_deg, error.right_roll_deg]))
        arms_px = np.array([rig.left.K[0, 0], rig.left.K[0, 0], rig.left.width_px / 2])
        found.append([*turns * arms_px, error.baseline_ratio, *error.center_px, error.distortion_ratio])
    sizes = [
        usual.yaw_px,
        usual.pitch_px,
        usual.roll_px,
        usual.baseline_ratio,
        *usual.center_px,
        usual.distortion_ratio,
    ]
    is_there = np.array(found).any(axis=0)  # all around there is no centre, and not every lens bends
    times = np.array(found)[:, is_there] / np.array(sizes)[is_there]
    assert is_there[:4].all()
    assert (times.min(axis=0) < 0).all()
    assert (times.max(axis=0) > 0).all()
    np.testing.assert_array_less(np.abs(np.abs(times) - 1), SPREAD + 1e-9)


@every_rig
def test_a_resized_picture_shows_the_same_in_other_pixels(rig: Rig) -> None:
    half = resized(rig.left, 0.5)
    points = np.random.default_rng(1).uniform([-0.3, -0.3, 1], [0.3, 0.3, 3], (50, 3))
    np.testing.assert_allclose(half.project(points), (rig.left.project(points) + 0.5) / 2 - 0.5)
    with pytest.raises(VobenchError, match=r"picture_scale 0\.3333 needs a focal length"):
        resized(rig.left, 0.3333)


@pytest.mark.parametrize("percent", range(5, 105, 5))
def test_a_scale_that_leaves_whole_pixels_is_not_refused_for_rounding(percent: int) -> None:
    camera = Pinhole(1280, 720, 640.0, 640.0, 639.5, 359.5)
    smaller = resized(camera, percent / 100)
    assert (smaller.width_px, smaller.height_px) == (1280 * percent // 100, 720 * percent // 100)


@pytest.mark.parametrize("scale", [0.3501, 0.35 + 1e-6, 1 / 1280])
def test_a_scale_that_leaves_part_of_a_pixel_or_hardly_one_is_refused(scale: float) -> None:
    with pytest.raises(VobenchError, match=r"must give a whole width and height"):
        resized(Pinhole(1280, 720, 640.0, 640.0, 639.5, 359.5), scale)


def test_an_error_that_has_nothing_to_act_on_is_refused() -> None:
    with pytest.raises(VobenchError, match=r"^distortion_ratio 0\.1 needs a lens with distortion, got Pinhole"):
        true_rig(RIGS["d435i"], CalibrationError(distortion_ratio=0.1))
    all_around = stereo_rig(Equirectangular(640, 320), pitch_deg=0)
    with pytest.raises(VobenchError, match=r"^focal_ratio and center_px need a camera with a focal length, got Equi"):
        true_rig(all_around, CalibrationError(center_px=(1.0, 0.0)))
    assert true_rig(all_around, CalibrationError(right_yaw_deg=1.0)).left == all_around.left


# Fields of view across and down, and baselines, as their makers state them.
VIEWS_DEG = {"d435i": (89.56, 58.64), "zed2i": (110.0, 70.0), "tartanair": (90.0, 73.74)}
BASELINES_M = {"euroc": 0.110, "d435i": 0.050, "zed2i": 0.12, "tartanair": 0.25, "fisheye": 0.101}

every_preset = pytest.mark.parametrize("preset", PRESETS.values(), ids=list(PRESETS))


@every_preset
def test_both_eyes_of_a_preset_are_lenses_of_one_make(preset: StereoPreset) -> None:
    """They bend alike: to a hundredth at all angles within the picture, and to a thousandth near the middle."""
    lenses = preset.left, preset.right
    ahead = preset.left.rays([[preset.left.width_px - 1.0, preset.left.K[1, 2]]])[0]
    angles = np.linspace(0.02, np.arctan2(ahead[0], ahead[2]), 50)
    ways = np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)])
    first, second = ((lens.project(ways)[:, 0] - lens.K[0, 2]) / lens.K[0, 0] for lens in lenses)
    np.testing.assert_allclose(first, second, rtol=0.01)
    np.testing.assert_allclose(first[:10], second[:10], rtol=0.001)


@every_preset
def test_the_cameras_stand_side_by_side_and_look_the_same_way(preset: StereoPreset) -> None:
    T = preset.T_left_right
    assert se3.is_rotation(T[:3, :3], tolerance=1e-12)
    assert se3.rotation_angle(T[:3, :3]) < np.deg2rad(3)
    right, *aside = T[:3, 3]
    assert right > 10 * np.abs(aside).max()


@every_preset
def test_both_cameras_look_ahead_through_the_middle_of_their_pictures(preset: StereoPreset) -> None:
    for camera in (preset.left, preset.right):
        middle = np.array([camera.width_px - 1, camera.height_px - 1]) / 2
        assert (np.abs(camera.project([0, 0, 1.0]) - middle) < 0.03 * camera.width_px).all()


@pytest.mark.parametrize("name", VIEWS_DEG)
def test_the_field_of_view_is_the_stated_one(name: str) -> None:
    camera = PRESETS[name].left
    (u, v), (width, height) = camera.K[:2, 2], (camera.width_px - 0.5, camera.height_px - 0.5)
    left, right, top, bottom = np.rad2deg(np.arccos(camera.rays([[-0.5, v], [width, v], [u, -0.5], [u, height]])[:, 2]))
    # The ZED's maker rounds up to the most that any of its modes may show.
    np.testing.assert_allclose([left + right, top + bottom], VIEWS_DEG[name], atol=6 if name == "zed2i" else 0.01)


@pytest.mark.parametrize("name", BASELINES_M)
def test_the_baseline_is_the_stated_one(name: str) -> None:
    assert PRESETS[name].baseline_m == pytest.approx(BASELINES_M[name], abs=1e-4)


@every_preset
def test_another_baseline_moves_the_right_camera_and_turns_it_not(preset: StereoPreset) -> None:
    T = preset.at_baseline(0.2)
    assert np.linalg.norm(T[:3, 3]) == pytest.approx(0.2, rel=1e-14)
    np.testing.assert_array_equal(T[:3, :3], preset.T_left_right[:3, :3])
    np.testing.assert_allclose(np.cross(T[:3, 3], preset.T_left_right[:3, 3]), 0, atol=1e-16)
    np.testing.assert_allclose(preset.at_baseline(preset.baseline_m), preset.T_left_right, rtol=1e-15)


@pytest.mark.parametrize("name", LENSES)
def test_the_papers_presets_on_the_robot_are_its_rig_to_the_last_bit(name: str) -> None:
    preset = PRESETS[name]
    old = stereo_rig(LENSES[name], pitch_deg=33.3, baseline_m=0.12)
    new = mounted_rig(preset.left, preset.right, preset.at_baseline(0.12), pitch_deg=33.3)
    assert (new.left, new.right) == (old.left, old.right)
    assert new.T_body_right.tobytes() == old.T_body_right.tobytes()


@every_preset
def test_a_preset_names_its_source(preset: StereoPreset) -> None:
    assert len(preset.source) > 20


def test_the_page_about_rigs_lists_every_preset() -> None:
    page = (Path(__file__).parents[2] / "docs" / "rigs.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    assert set(PRESETS) <= {row.strip(" `") for row in rows}


LITERAL, BLENDER = LENSES["paper_literal"], LENSES["paper_blender"]
PITCHES_DEG = (-10.0, 0.0, 15.0, 33.3, 90.0)


def test_the_papers_lens_has_the_papers_numbers() -> None:
    assert (LITERAL.width_px, LITERAL.height_px) == (720, 480)
    assert LITERAL.fx_px == pytest.approx(658.2857, abs=1e-4)
    assert LITERAL.fy_px == pytest.approx(545.0674, abs=1e-4)
    assert BLENDER.fx_px == BLENDER.fy_px == LITERAL.fx_px
    assert paper_lens(square_pixels=True) == BLENDER


@pytest.mark.parametrize("lens", LENSES.values(), ids=list(LENSES))
def test_the_optical_axis_meets_the_middle_of_the_picture(lens: Pinhole) -> None:
    # Pixel centres are integers, so the middle of 720 columns lies between 359 and 360.
    assert (lens.cx_px, lens.cy_px) == (359.5, 239.5)


@pytest.mark.parametrize("pitch_deg", PITCHES_DEG)
def test_a_camera_looks_down_by_its_pitch_and_keeps_its_horizon_level(pitch_deg: float) -> None:
    T_body_camera = looking(pitch_deg=pitch_deg, position_m=(0.1, 0.2, 0.3))
    right, down, forward = T_body_camera[:3, :3].T
    assert se3.is_rotation(T_body_camera[:3, :3])
    assert np.rad2deg(np.arctan2(-forward[2], forward[0])) == pytest.approx(pitch_deg)
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-15)
    assert down[2] < 1e-15
    np.testing.assert_array_equal(T_body_camera[:3, 3], [0.1, 0.2, 0.3])


def test_a_camera_that_looks_down_sees_the_floor_below_it_with_ahead_at_the_top() -> None:
    rig = stereo_rig(BLENDER, pitch_deg=90, baseline_m=0.2, forward_m=0.25, height_m=0.4)
    below, ahead = rig.left.project(se3.apply(se3.inverse(rig.T_body_left), [[0.25, 0.1, 0], [0.35, 0.1, 0]]))
    np.testing.assert_allclose(below, [359.5, 239.5], atol=1e-9)
    np.testing.assert_allclose(ahead - below, [0, -BLENDER.fy_px * 0.1 / 0.4], atol=1e-9)


@pytest.mark.parametrize("pitch_deg", PITCHES_DEG)
def test_the_right_camera_is_a_baseline_to_the_right_and_looks_the_same_way(pitch_deg: float) -> None:
    rig = stereo_rig(LITERAL, pitch_deg=pitch_deg, baseline_m=0.117)
    T_left_right = np.eye(4)
    T_left_right[0, 3] = 0.117
    np.testing.assert_allclose(rig.T_left_right, T_left_right, atol=1e-15)
    assert rig.baseline_m == pytest.approx(0.117)
    assert rig.T_body_left[1, 3] > rig.T_body_right[1, 3]  # y is left


def test_near_things_lie_further_left_in_the_right_picture() -> None:
    rig = stereo_rig(LITERAL, pitch_deg=0, baseline_m=0.12)
    point = np.array([[2.25, 0.3, 0.5]])  # 2 m before the cameras
    left = rig.left.project(se3.apply(se3.inverse(rig.T_body_left), point))[0]
    right = rig.right.project(se3.apply(se3.inverse(rig.T_body_right), point))[0]
    np.testing.assert_allclose(left - right, [LITERAL.fx_px * 0.12 / 2, 0], atol=1e-9)


def test_the_cameras_sit_astride_the_robots_middle() -> None:
    rig = stereo_rig(LITERAL, pitch_deg=15, baseline_m=0.12, forward_m=0.25, height_m=0.4)
    middle = (rig.T_body_left[:3, 3] + rig.T_body_right[:3, 3]) / 2
    np.testing.assert_allclose(middle, [0.25, 0, 0.4], atol=1e-15)
    assert rig.wheels == PIONEER_WHEELS


@pytest.mark.parametrize("name", ["radius_m", "track_m", "ticks_per_revolution"])
@pytest.mark.parametrize("value", [0, -1, float("nan"), float("inf")])
def test_a_wheel_without_size_is_refused_by_name(name: str, value: float) -> None:
    with pytest.raises(SettingError, match=f"^{name}: should be (greater than 0|a whole number|a finite number)"):
        replace(PIONEER_WHEELS, **{name: value})


def test_the_errors_drawn_from_a_seed_stay_the_same() -> None:
    given = CalibrationError(level="worn", right_roll_deg=0.2, baseline_ratio=0.1)
    rng = np.random.default_rng(3)
    signs = rng.choice([-1.0, 1.0], 8)
    yaw, roll, pitch, focal, baseline, x, y, distortion = signs * rng.uniform(1 - SPREAD, 1 + SPREAD, 8)
    usual = RESIDUALS["worn"]
    error = drawn_calibration_error(given, EUROC, np.random.default_rng(3))
    f_px = EUROC.left.fx_px

    assert error.right_yaw_deg == pytest.approx(np.degrees(yaw * np.arctan(usual.yaw_px / f_px)))
    assert error.right_pitch_deg == pytest.approx(np.degrees(pitch * np.arctan(usual.pitch_px / f_px)))
    roll_deg = np.degrees(np.arctan(usual.roll_px / (EUROC.left.width_px / 2)))
    assert error.right_roll_deg == pytest.approx(0.2 + roll * roll_deg)
    assert error.focal_ratio == pytest.approx(focal * usual.focal_ratio)
    assert error.baseline_ratio == pytest.approx(0.1 + baseline * usual.baseline_ratio)
    assert error.center_px == pytest.approx((x * usual.center_px[0], y * usual.center_px[1]))
    assert error.distortion_ratio == pytest.approx(distortion * usual.distortion_ratio)
    assert error.level == "none"


def test_a_settings_class_of_errors_is_no_error_by_default() -> None:
    numbers = [getattr(CameraError(), name) for name in CameraError.__dataclass_fields__]
    assert numbers == [0.0, (0.0, 0.0), 0.0, (0.0, 0.0), 0.0, 0.0, 0.0]
    error = CalibrationError()
    assert (error.level, error.left, error.right) == ("none", CameraError(), CameraError())
    assert error.of_eye("left") == error.of_eye("right") == CameraError()
    assert drawn_calibration_error(error, EUROC, np.random.default_rng(0)) is error


@pytest.mark.parametrize("preset", PRESETS.values(), ids=list(PRESETS))
def test_a_presets_lens_has_nearly_square_pixels_and_its_centre_near_that_of_the_picture(preset: StereoPreset) -> None:
    for camera in (preset.left, preset.right):
        if camera != LENSES["paper_literal"]:
            assert camera.fx_px == pytest.approx(camera.fy_px, rel=0.01)
        assert camera.cx_px == pytest.approx(camera.width_px / 2, rel=0.05)
        assert camera.cy_px == pytest.approx(camera.height_px / 2, rel=0.1)
    assert preset.left.fx_px == pytest.approx(preset.right.fx_px, rel=0.01)


def test_an_own_pair_without_turns_is_parallel_and_its_right_lens_is_by_default_the_left_one() -> None:
    lens = lens_of(EUROC.left)
    pair = CustomStereoPair(left=lens, right_at_m=(0.3, 0.0, 0.0)).preset()

    assert pair.right == pair.left == EUROC.left
    np.testing.assert_array_equal(pair.T_left_right, se3.transform(np.eye(3), [0.3, 0, 0]))


@pytest.mark.parametrize(
    ("model", "distortion", "fits"),
    [
        ("pinhole", (), True),
        ("pinhole", (0.1,), False),
        ("brown_conrady", (0.1,), False),
        ("brown_conrady", (0.1, 0.2), True),
        ("brown_conrady", (0.1, 0.2, 0.0, 0.0, 0.3), True),
        ("brown_conrady", (0.1, 0.2, 0.0, 0.0, 0.3, 0.4), False),
        ("double_sphere", (0.1, 0.5), True),
        ("double_sphere", (0.1,), False),
        ("kannala_brandt", (0.1, 0.0, 0.0, 0.0), True),
    ],
)
def test_a_lens_takes_the_coefficients_of_its_model(model: str, distortion: tuple[float, ...], fits: bool) -> None:
    lens = Lens(model=model, size_px=(64, 48), focal_px=(50.0, 51.0), center_px=(32.0, 24.0), distortion=distortion)
    if not fits:
        with pytest.raises(SettingError, match="distortion"):
            lens.build()
        return
    camera = lens.build()
    assert (camera.width_px, camera.height_px, camera.fx_px, camera.cy_px) == (64, 48, 50.0, 24.0)
    assert tuple(getattr(camera, name) for name in camera.coefficients)[: len(distortion)] == distortion


def test_a_camera_without_a_focal_length_is_no_lens_of_a_suite() -> None:
    with pytest.raises(InputError, match="need a focal length, which this camera lacks"):
        lens_of(Equirectangular(64, 32))


def test_a_rig_of_one_camera_has_no_right_one() -> None:
    single = replace(EUROC, right=None, T_body_right=None)

    assert single.sides == ("left",)
    assert EUROC.sides == ("left", "right")
    assert single.camera("left") == EUROC.camera("left") == EUROC.left
    for ask in (single.camera, single.T_body_camera):
        with pytest.raises(InputError, match="a stereo pair needs two cameras, but this rig has one"):
            ask("right")
    assert rectification(single) is None


def test_a_baseline_of_a_rig_is_the_distance_of_its_cameras() -> None:
    assert stereo_rig(LENSES["paper_blender"], baseline_m=0.25, pitch_deg=30).baseline_m == pytest.approx(0.25)
    distance_m = np.linalg.norm(EUROC.T_body_left[:3, 3] - EUROC.T_body_right[:3, 3])
    assert EUROC.baseline_m == pytest.approx(distance_m)


def test_a_projection_matrix_shifts_points_before_it_projects_them() -> None:
    K = np.array([[100.0, 0, 50], [0, 110, 40], [0, 0, 1]])
    pixel = projection(K, 0.5) @ [1.0, 2.0, 4.0, 1.0]

    np.testing.assert_allclose(pixel[:2] / pixel[2], [100 * (1 - 0.5) / 4 + 50, 110 * 2 / 4 + 40])
