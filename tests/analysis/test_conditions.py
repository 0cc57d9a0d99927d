"""Each condition grows with its physical cause, and where a law is exact, as that says."""

import json
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from vobench.analysis.conditions import (
    CONDITIONS,
    SubsampledCamera,
    _contrast,
    _inverse_steps,
    chip_noise_dn,
    conditions,
)
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.rig import CalibrationError, CameraError, custom_stereo_pair, looking, stereo_rig
from vobench.scene.fog import Fog
from vobench.scene.material import Material, srgb
from vobench.sensor.image_sensor import CameraSensor
from vobench.sensor.timing import Timing
from vobench.sequence.reader import StereoFrame
from vobench.suite.axis import RigSettings
from vobench.suite.case import Case
from vobench.suite.scene_spec import (
    BoardSpec,
    BoxSpec,
    DiffuseSpec,
    GlassSpec,
    MirrorSpec,
    MoverSpec,
    PathKey,
    PolishedSpec,
)
from vobench.suite.suite import read_plan
from vobench.suite.yaml_file import plain
from vobench.trajectory.trajectory import Trajectory

FOCAL_PX = 200.0
BASELINE_M = 0.2
LENS = Pinhole(240, 160, FOCAL_PX, FOCAL_PX, 119.5, 79.5)
STEP_NS = 100_000_000
STOPS_PER_GREY_OCTAVE = 2.2  # a response of gamma 2.2
SCENE = """
name: wall
white_cd_m2: 50
materials: {plaster: {pattern: plain, albedo: 0.5, resolution_px: 8}}
boards: [{name: wall, center_m: [4, 0, 0], size_m: [100, 100], yaw_deg: 180, material: plaster}]
lamps: [{name: lamp, kind: point, center_m: [-2, 0, 0], power_lm: 100}]
"""


@pytest.fixture(scope="module")
def wall(tmp_path_factory: pytest.TempPathFactory) -> Case:
    """A case of a plain wall that fills the view, 4 m ahead of the origin, and a camera without any effect."""
    root = tmp_path_factory.mktemp("wall")
    rig: Any = plain(
        RigSettings(own=custom_stereo_pair(stereo_rig(LENS, pitch_deg=0, baseline_m=BASELINE_M)), pitch_deg=0)
    )
    suite = {
        "name": "wall",
        "scenes": ["wall"],
        "rigs": {"ahead": {"own": rig["own"], "pitch_deg": 0, "forward_m": 0, "height_m": 0}},
        "trajectories": {"short": {"targets_m": [[0.3, 0]], "tolerance_m": 0.03, "rate_hz": 10}},
        "cameras": {"clean": {"exposure_ms": 10, "motion_blur": False}},
        "estimators": ["stand_still"],
    }
    (root / "wall.yaml").write_text(SCENE)
    (root / "suite.yaml").write_text(json.dumps(suite))
    (case,) = read_plan(str(root / "suite.yaml")).simulated
    return case


def camera(case: Case, **settings: Any) -> Case:
    return replace(case, camera=replace(case.camera, **settings))


def scene(case: Case, **settings: Any) -> Case:
    return replace(case, scene=replace(case.scene, **settings))


def grey(value: float, share: float = 1.0, rest: float = 128) -> np.ndarray:
    """An image of which a share of the pixels has a grey value."""
    image = np.full(100, rest)
    image[: round(100 * share)] = value
    return image.reshape(10, 10).astype(np.uint8)


def conditions_of(
    case: Case,
    *,
    moved_m: tuple[float, float, float] = (0, 0, 0),
    turned_deg: float = 0.0,
    left: tuple[np.ndarray, ...] = (grey(128), grey(128)),
    right: np.ndarray | None = None,
    exposures: tuple[tuple[float, float], ...] = (),
    t_ns: tuple[int, ...] = (0, STEP_NS),
) -> dict[str, np.ndarray]:
    """The conditions of frames at the origin, each moved and turned from the one before."""
    ahead = looking(pitch_deg=0, position_m=(0, 0, 0))
    poses = []
    for nth in range(len(t_ns)):
        turn = se3.rotation_z(np.deg2rad(nth * turned_deg))
        poses.append(se3.transform(turn, nth * np.array(moved_m)) @ ahead)
    frames = [
        StereoFrame(index, stamp, image, image if right is None else right)
        for index, (stamp, image) in enumerate(zip(t_ns, left, strict=True))
    ]
    return conditions(
        case, Trajectory(np.array(t_ns), np.array(poses)), frames, dict(zip(t_ns, exposures, strict=False))
    )


def one(case: Case, name: str, **frames: Any) -> float:
    """A condition of the first frame."""
    return float(conditions_of(case, **frames)[name][0])


def second(case: Case, name: str, **frames: Any) -> float:
    """A condition of the second frame, which may depend on the first."""
    return float(conditions_of(case, **frames)[name][1])


def with_board(case: Case, side_m: float, material: Any) -> Case:
    """The wall with a square board of a material 2 m ahead."""
    board = BoardSpec(name="board", center_m=(2, 0, 0), size_m=(side_m, side_m), yaw_deg=180, material="of_board")
    boards = (*case.scene.boards, board)
    return scene(case, boards=boards, materials={**case.scene.materials, "of_board": material})


def test_every_condition_is_computed_of_every_frame(wall: Case) -> None:
    found = conditions_of(wall)
    assert list(found) == list(CONDITIONS)
    assert {values.shape for values in found.values()} == {(2,)}
    assert all(np.isfinite(values).all() for values in found.values())


# --- Shares of pixels ---


@pytest.mark.parametrize(
    ("name", "other", "material"),
    [
        ("mirror", "gloss", MirrorSpec()),
        ("mirror", "gloss", GlassSpec()),
        ("gloss", "mirror", PolishedSpec("plain", 0.5)),
    ],
)
def test_a_board_of_twice_the_area_is_twice_the_share_of_mirrors_or_of_gloss(wall, name, other, material) -> None:
    side_m = 0.6
    share = (side_m / 2 * FOCAL_PX) ** 2 / (LENS.width_px * LENS.height_px)
    small, large = (conditions_of(with_board(wall, s, material)) for s in (side_m, np.sqrt(2) * side_m))
    assert small[name][0] == pytest.approx(share, rel=0.1)
    assert large[name][0] == pytest.approx(2 * share, rel=0.1)
    assert large[other][0] == 0
    assert one(wall, name) == 0


def test_two_shadows_have_twice_the_edges_of_one(wall: Case) -> None:
    def box(number: int) -> BoxSpec:
        # Between the lamp and the wall, and out of view of the camera at the origin: only its shadow is seen.
        y = -0.25 + 0.5 * number
        return BoxSpec(name=f"box_{number}", center_m=(-1, y / 3, 0), size_m=(0.1, 0.1, 0.1), material="plaster")

    none, single, double = (
        one(scene(wall, boxes=tuple(box(number) for number in range(count))), "shadow_edge") for count in range(3)
    )
    assert none == 0
    assert 0.005 < single < 0.1
    assert double == pytest.approx(2 * single, rel=0.1)


def test_two_moving_objects_are_twice_the_share_of_one(wall: Case) -> None:
    def mover(number: int) -> MoverSpec:
        y = -0.4 + 0.8 * number
        path = (PathKey(t_s=0, position_m=(2, y, 0)), PathKey(t_s=1, position_m=(2, y, 0.01)))
        return MoverSpec(name=f"cart_{number}", size_m=(0.01, 0.4, 0.4), material="plaster", path=path)

    still = BoxSpec(name="still", center_m=(2, 0, 0.5), size_m=(0.2, 0.2, 0.2), material="plaster")
    none, single, double = (
        one(scene(wall, boxes=(still,), movers=tuple(mover(number) for number in range(count))), "moving")
        for count in range(3)
    )
    assert none == 0
    assert single == pytest.approx((0.4 / 2 * FOCAL_PX) ** 2 / (LENS.width_px * LENS.height_px), rel=0.1)
    assert double == pytest.approx(2 * single, rel=0.02)


@pytest.mark.parametrize(
    ("name", "value", "next_value"), [("burnt", 254, 253), ("burnt", 255, 253), ("black", 2, 3), ("black", 0, 3)]
)
def test_burnt_and_black_are_exactly_the_shares_of_pixels_at_the_ends(wall, name, value, next_value) -> None:
    for share in (0.1, 0.2):
        assert one(wall, name, left=(grey(value, share), grey(128))) == share
        assert one(wall, name, left=(grey(next_value, share), grey(128))) == 0


def test_a_colour_image_is_judged_by_its_grey_values(wall: Case) -> None:
    coloured = np.stack([grey(255, 0.5), grey(255, 0.25), grey(255, 0.25)], -1)
    assert one(wall, "burnt", left=(coloured, coloured)) == 0.25


# --- Geometry ---


def at_distance(case: Case, distance_m: float) -> Case:
    (board,) = case.scene.boards
    return scene(case, boards=(replace(board, center_m=(distance_m, 0, 0)),))


@pytest.mark.parametrize("distance_m", [2.0, 4.0, 8.0])
def test_depth_is_the_distance_and_disparity_its_inverse_times_baseline_and_focal_length(wall, distance_m) -> None:
    found = conditions_of(at_distance(wall, distance_m))
    assert found["depth"] == pytest.approx(distance_m, rel=1e-5)
    assert found["disparity"] == pytest.approx(FOCAL_PX * BASELINE_M / distance_m, rel=1e-5)


def test_where_nothing_is_seen_depth_disparity_and_flow_are_0(wall: Case) -> None:
    found = conditions_of(at_distance(wall, -2.0), moved_m=(0, 0.1, 0))
    for name in ("depth", "disparity", "flow", "calibration"):
        assert found[name].tolist() == [0, 0]


def test_flow_is_the_motion_in_pixels_until_the_next_frame_and_0_after_the_last(wall: Case) -> None:
    for step_m in (0.1, 0.2):
        flow_px = conditions_of(wall, moved_m=(0, step_m, 0))["flow"]
        assert flow_px == pytest.approx([FOCAL_PX * step_m / 4, 0], rel=1e-4)


def test_turn_is_the_angle_since_the_previous_frame(wall: Case) -> None:
    stamps = (0, STEP_NS, 2 * STEP_NS)
    for angle_deg in (1.5, -3.0):
        turn_deg = conditions_of(wall, turned_deg=angle_deg, t_ns=stamps, left=(grey(128),) * 3)["turn"]
        assert turn_deg == pytest.approx([0, abs(angle_deg), abs(angle_deg)])


def test_a_calibration_error_twice_as_large_moves_points_twice_as_far(wall: Case) -> None:
    assert one(wall, "calibration") < 1e-9
    for error_deg in (0.1, -0.2):
        rig = replace(wall.rig, calibration_error=CalibrationError(right_yaw_deg=error_deg))
        # The right camera alone is off, so the mean of both is half of its error at the centre, and more at the sides.
        at_centre_px = FOCAL_PX * np.deg2rad(abs(error_deg)) / 2
        assert at_centre_px < one(replace(wall, rig=rig), "calibration") < 1.15 * at_centre_px


def test_a_wrong_principal_point_moves_the_points_of_both_cameras_by_as_much(wall: Case) -> None:
    both = CalibrationError(center_px=(0.3, -0.4))
    left, right = (CalibrationError(**{side: CameraError(center_px=(0.3, -0.4))}) for side in ("left", "right"))
    for error, expected_px in ((both, 0.5), (left, 0.25), (right, 0.25)):
        case = replace(wall, rig=replace(wall.rig, calibration_error=error))
        assert one(case, "calibration") == pytest.approx(expected_px)


@pytest.mark.parametrize("step", [1, 2, 5])
def test_a_subsampled_camera_has_every_nth_pixel_and_projects_its_own_rays_to_them(step: int) -> None:
    sampled = SubsampledCamera(LENS, step)
    assert (sampled.width_px, sampled.height_px) == (240 // step, 160 // step)
    assert sampled.depth_along == LENS.depth_along
    pixels = pixel_grid(sampled)  # type: ignore[arg-type]
    np.testing.assert_allclose(sampled.project(3.0 * sampled.rays(pixels)), pixels, atol=1e-9)
    in_full = LENS.project(sampled.rays(pixels)).reshape(-1, 2)
    np.testing.assert_allclose(in_full[0], (step - 1) / 2, atol=1e-9)  # the middle of the first step x step pixels
    np.testing.assert_allclose(in_full[1] - in_full[0], [step, 0], atol=1e-9)


# --- Texture ---


def contrast_of(case: Case, material: Any) -> float:
    """The contrast that faintness is the inverse of, of a wall of a material."""
    return 1 / one(scene(case, materials={"plaster": material}), "faintness") - 0.02


def test_faintness_is_the_inverse_of_the_contrast_and_50_for_a_plain_wall(wall: Case) -> None:
    assert one(wall, "faintness") == pytest.approx(50)
    weak, strong = (
        contrast_of(wall, DiffuseSpec("terrazzo", 0.4, contrast=share, resolution_px=64)) for share in (0.2, 0.4)
    )
    assert weak > 0.01
    assert strong == pytest.approx(2 * weak, rel=0.1)


def test_contrast_is_the_deviation_of_the_texture_over_its_mean(wall: Case) -> None:
    material = DiffuseSpec("terrazzo", 0.4, contrast=0.5, resolution_px=64)
    pixels = np.asarray(material.build().texture.pixels(), float)
    assert contrast_of(wall, material) == pytest.approx(pixels.std() / pixels.mean(), rel=0.05)


def test_a_mirror_has_no_texture_of_its_own_and_what_is_behind_the_camera_does_not_count(wall: Case) -> None:
    textured = DiffuseSpec("terrazzo", 0.4, contrast=0.5, resolution_px=64)
    case = scene(wall, materials={"plaster": textured})
    assert one(with_board(case, 1.0, MirrorSpec()), "faintness") == pytest.approx(one(case, "faintness"))
    behind = BoardSpec(name="behind", center_m=(-3, 0, 0), size_m=(5, 5), yaw_deg=0, material="of_board")
    materials = {"plaster": textured, "of_board": DiffuseSpec("plain", 0.5, resolution_px=8)}
    other = scene(wall, boards=(*wall.scene.boards, behind), materials=materials)
    assert one(other, "faintness") == pytest.approx(one(case, "faintness"))


# --- Camera ---


def test_motion_blur_grows_with_speed_and_exposure_as_a_uniform_smear(wall: Case) -> None:
    moving = camera(wall, motion_blur=True)
    for step_m, exposure_s in ((0.1, 0.01), (0.2, 0.01), (0.1, 0.02)):
        smear_px = FOCAL_PX * step_m / 4 / 0.1 * exposure_s
        blur_px = one(moving, "blur", moved_m=(0, step_m, 0), exposures=((exposure_s, 0.0),))
        assert blur_px == pytest.approx(smear_px / np.sqrt(12), rel=1e-4)
    assert one(wall, "blur", moved_m=(0, 0.1, 0)) == 0


def test_blurs_of_lens_and_focus_add_in_quadrature(wall: Case) -> None:
    lens, focus, both = (
        one(camera(wall, **settings), "blur")
        for settings in (
            {"blur_sigma_px": 0.6},
            {"defocus_px": 3.2},
            {"blur_sigma_px": 0.6, "defocus_px": 3.2},
        )
    )
    assert lens == pytest.approx(0.6)
    assert focus == pytest.approx(3.2 / 4)  # a disc's deviation along one axis is a quarter of its diameter
    assert both == pytest.approx(1.0)
    moving = camera(wall, motion_blur=True, blur_sigma_px=0.6, defocus_px=3.2)
    smear_px = one(camera(wall, motion_blur=True), "blur", moved_m=(0, 0.8, 0))
    assert one(moving, "blur", moved_m=(0, 0.8, 0)) == pytest.approx(np.hypot(1.0, smear_px))


def test_rolling_is_the_motion_within_the_readout_and_0_for_a_global_shutter(wall: Case) -> None:
    for readout_ms in (10, 20):
        rolling = camera(wall, shutter="rolling", readout_ms=readout_ms)
        expected_px = FOCAL_PX * 0.1 / 4 / 0.1 * readout_ms / 1e3
        assert one(rolling, "rolling", moved_m=(0, 0.1, 0)) == pytest.approx(expected_px, rel=0.01)
    assert one(wall, "rolling", moved_m=(0, 0.1, 0)) == 0


def test_late_images_are_the_motion_within_delay_and_jitter(wall: Case) -> None:
    for delay_ms, jitter_ms in [(20, 0), (-20, 0), (15, 5)]:
        late = camera(wall, timing=Timing(right_delay_ms=delay_ms, jitter_ms=jitter_ms))
        expected_px = FOCAL_PX * 0.1 / 4 / 0.1 * 20e-3
        assert one(late, "late_images", moved_m=(0, 0.1, 0)) == pytest.approx(expected_px, rel=0.01)
    assert one(wall, "late_images", moved_m=(0, 0.1, 0)) == 0


def test_compression_is_what_quality_lacks_to_100(wall: Case) -> None:
    assert one(camera(wall, jpeg_quality=30), "compression") == pytest.approx(0.7)
    assert one(wall, "compression") == 0


def test_dirt_drops_and_flare_are_what_the_camera_has(wall: Case) -> None:
    dirty = camera(wall, dirt=0.2, lens_drops=0.3, flare=0.1, ghost=0.05)
    assert one(dirty, "lens_dirt") == pytest.approx(0.2)
    assert one(dirty, "lens_drops") == pytest.approx(0.3)
    assert one(dirty, "flare") == pytest.approx(0.15)
    assert [one(wall, name) for name in ("lens_dirt", "lens_drops", "flare")] == [0, 0, 0]


def test_fog_takes_the_more_light_the_further_things_are(wall: Case) -> None:
    depth_m = one(wall, "depth")
    foggy = scene(wall, fog=Fog(visibility_m=10))
    assert one(foggy, "fog") == pytest.approx(1 - 0.02 ** (depth_m / 10))  # 2 % is left at the visibility
    assert one(wall, "fog") == 0


def test_the_last_frame_has_the_speed_of_the_step_before(wall: Case) -> None:
    moving = camera(wall, motion_blur=True)
    stamps = (0, STEP_NS, 3 * STEP_NS)
    found = conditions_of(moving, moved_m=(0, 0.1, 0), t_ns=stamps, left=(grey(128),) * 3)
    assert found["blur"][1] == pytest.approx(found["blur"][0] / 2, rel=1e-4)  # as far in twice the time
    assert found["blur"][2] == 0


def linear_chip(**settings: Any) -> CameraSensor:
    return CameraSensor(**{"full_well_e": 10_000.0, "response": 1.0, **settings})


def test_noise_at_a_grey_value_is_that_of_emva_1288() -> None:
    read_e = 20.0
    for grey_dn in (40.0, 160.0):
        electrons = 10_000 * grey_dn / 255
        noise_e = np.sqrt(read_e**2 + electrons)
        chip = linear_chip(read_noise_e=read_e, shot_noise=True)
        assert chip_noise_dn(chip, grey_dn) == pytest.approx(255 * noise_e / 10_000, rel=1e-6)


def test_noise_doubles_with_read_noise_and_with_6_db_and_halves_with_four_times_the_full_well() -> None:
    quiet, noisy = (chip_noise_dn(linear_chip(read_noise_e=read_e), 100) for read_e in (10.0, 20.0))
    assert noisy == pytest.approx(2 * quiet)
    assert chip_noise_dn(linear_chip(read_noise_e=10.0), 100, gain_db=20 * np.log10(2)) == pytest.approx(2 * quiet)
    small, large = (chip_noise_dn(linear_chip(full_well_e=e, shot_noise=True), 100) for e in (5000.0, 20_000.0))
    assert small == pytest.approx(2 * large)
    assert chip_noise_dn(linear_chip(), 100) == 0


def test_amplified_shot_noise_grows_with_the_root_of_the_amplification() -> None:
    chip = linear_chip(shot_noise=True)
    ratio = chip_noise_dn(chip, 100, gain_db=20 * np.log10(4)) / chip_noise_dn(chip, 100)
    assert ratio == pytest.approx(2)


def test_a_steep_response_shows_more_noise() -> None:
    linear, steep = (chip_noise_dn(CameraSensor(read_noise_e=10.0, response=r), 20.0) for r in (1.0, 2.2))
    assert steep > 2 * linear
    assert chip_noise_dn(linear_chip(read_noise_e=10.0), 0.0) == pytest.approx(
        chip_noise_dn(linear_chip(read_noise_e=10.0), 255.0)
    )


def test_the_noise_of_a_frame_is_that_of_its_mean_and_gain(wall: Case) -> None:
    chip = linear_chip(read_noise_e=20.0, shot_noise=True)
    case = camera(wall, chip=chip)
    dark, bright, amplified = (
        one(case, "noise", left=(image, grey(128)), exposures=((0.01, gain_db),))
        for image, gain_db in ((grey(40), 0.0), (grey(200, 0.5, rest=100), 0.0), (grey(40), 12.0))
    )
    assert dark == pytest.approx(chip_noise_dn(chip, 40))
    assert bright == pytest.approx(chip_noise_dn(chip, 150))
    assert amplified == pytest.approx(chip_noise_dn(chip, 40, gain_db=12.0))
    assert one(camera(case, gain_db=12.0), "noise", left=(grey(40), grey(128))) == pytest.approx(amplified)


# --- Changes between frames and between cameras ---


def test_exposure_jumps_by_one_stop_for_twice_the_time_or_6_db_and_by_none_if_these_cancel(wall: Case) -> None:
    six_db = 20 * np.log10(2)
    for exposure_s, gain_db, stops in (
        (0.02, 0.0, 1.0),
        (0.04, 0.0, 2.0),
        (0.005, 0.0, 1.0),
        (0.01, six_db, 1.0),
        (0.02, six_db, 2.0),
        (0.02, -six_db, 0.0),
    ):
        jump = conditions_of(wall, exposures=((0.01, 0.0), (exposure_s, gain_db)))["exposure_jump"]
        assert jump == pytest.approx([0, stops], abs=1e-9)


def test_a_frame_without_a_known_exposure_has_the_cameras(wall: Case) -> None:
    longer = camera(wall, exposure_ms=20.0, gain_db=20 * np.log10(2))
    assert second(longer, "exposure_jump", exposures=((0.01, 0.0),)) == pytest.approx(2)


def test_light_jumps_by_the_change_of_brightness_that_exposure_does_not_explain(wall: Case) -> None:
    frames = (grey(64), grey(128))
    assert second(wall, "light_jump", left=frames) == pytest.approx(STOPS_PER_GREY_OCTAVE)
    assert second(wall, "light_jump", left=frames[::-1]) == pytest.approx(STOPS_PER_GREY_OCTAVE)
    assert second(wall, "light_jump", left=(grey(32), grey(128))) == pytest.approx(2 * STOPS_PER_GREY_OCTAVE)
    explained = ((0.01, 0.0), (0.01 * 2**STOPS_PER_GREY_OCTAVE, 0.0))
    assert second(wall, "light_jump", left=frames, exposures=explained) == pytest.approx(0, abs=1e-9)
    amplified = ((0.01, 0.0), (0.01, STOPS_PER_GREY_OCTAVE * 20 * np.log10(2)))
    assert second(wall, "light_jump", left=frames, exposures=amplified) == pytest.approx(0, abs=1e-9)
    against = ((0.01 * 2**STOPS_PER_GREY_OCTAVE, 0.0), (0.01, 0.0))
    assert second(wall, "light_jump", left=frames, exposures=against) == pytest.approx(2 * STOPS_PER_GREY_OCTAVE)
    assert one(wall, "light_jump", left=frames) == 0


def test_unlike_eyes_differ_by_the_stops_between_their_means_whichever_is_brighter(wall: Case) -> None:
    for right, octaves in ((64, 1), (32, 2), (128, 0)):
        difference = one(wall, "unlike_eyes", right=grey(right))
        assert difference == pytest.approx(octaves * STOPS_PER_GREY_OCTAVE)
    dark = (grey(64), grey(64))
    assert one(wall, "unlike_eyes", left=dark, right=grey(128)) == pytest.approx(STOPS_PER_GREY_OCTAVE)


def test_black_images_are_as_dark_as_a_grey_value_of_1(wall: Case) -> None:
    assert second(wall, "light_jump", left=(grey(0), grey(2))) == pytest.approx(STOPS_PER_GREY_OCTAVE)


def test_one_camera_has_no_difference_of_eyes(wall: Case) -> None:
    ahead = looking(pitch_deg=0, position_m=(0, 0, 0))
    frame = StereoFrame(0, 0, grey(128), None)
    found = conditions(wall, Trajectory(np.array([0]), ahead[None]), [frame], {})
    assert found["unlike_eyes"].tolist() == [0]
    assert found["missing_frames"].tolist() == [0]


def test_missing_frames_are_counted_from_the_gap_in_the_stamps(wall: Case) -> None:
    steps = np.array([0, 1, 2, 4, 5, 8, 9, 10, 11]) * STEP_NS
    jittered = steps + np.array([0, 1, -1, 1, 0, -1, 1, 0, 0]) * STEP_NS // 10
    stamps = tuple(jittered.tolist())
    missing = conditions_of(wall, t_ns=stamps, left=(grey(128),) * len(stamps))["missing_frames"]
    assert missing.tolist() == [0, 0, 0, 1, 0, 2, 0, 0, 0]


def test_frames_are_read_in_order(wall: Case) -> None:
    stamps = (0, STEP_NS, 2 * STEP_NS)
    left = (grey(255, 0.1), grey(255, 0.2), grey(255, 0.3))
    assert conditions_of(wall, t_ns=stamps, left=left)["burnt"] == pytest.approx([0.1, 0.2, 0.3])


def test_of_mirrors_alone_nothing_has_a_texture(wall: Case) -> None:
    assert one(scene(wall, materials={"plaster": MirrorSpec()}), "faintness") == pytest.approx(50)


@dataclass(frozen=True, slots=True)
class Stripes:
    """A texture of stripes of two pixels, dark and bright."""

    axis: int
    colours: bool = False

    def pixels(self) -> np.ndarray:
        rows = np.where(np.arange(64) % 4 < 2, 0.2, 0.6)
        grey = np.tile(rows[:, None], (1, 64))
        grey = grey if self.axis == 0 else grey.T
        return np.repeat(srgb(np.float32(grey)[..., None]), 3, axis=-1) if self.colours else grey


@dataclass(frozen=True, slots=True)
class Grey:
    """A texture of two equal parts that reflect half as much and one and a half times as much as the mean."""

    mean: float

    def pixels(self) -> np.ndarray:
        halves = np.repeat([0.5, 1.5], 32)
        return np.tile(self.mean * halves, (64, 1))


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("colours", [False, True])
def test_stripes_of_two_pixels_are_seen_in_both_directions(axis: int, colours: bool) -> None:
    contrast = _contrast(Material(texture=Stripes(axis, colours)))
    assert contrast == pytest.approx(0.2 / 0.4, rel=0.02)


@pytest.mark.parametrize("reflectance", [0.4, 0.02, 0.0015])
def test_a_dark_texture_has_the_contrast_of_a_bright_one_down_to_a_reflectance_of_a_tenth_of_a_percent(
    reflectance: float,
) -> None:
    assert _contrast(Material(texture=Grey(reflectance))) == pytest.approx(0.5, rel=0.01)


def test_what_reflects_nothing_has_no_contrast() -> None:
    assert _contrast(Material(texture=Grey(0.0))) == 0
    assert _contrast(Material(texture=Grey(1e-5))) < 0.01


def test_bodies_without_a_texture_have_no_contrast_and_mirrors_none_that_is_known() -> None:
    assert _contrast(Material()) == 0
    assert np.isnan(_contrast(None))
    assert np.isnan(_contrast(MirrorSpec().build()))


def test_darkness_is_the_inverse_of_the_mean_grey_value(wall: Case) -> None:
    assert one(wall, "darkness", left=(grey(50), grey(50))) == pytest.approx(1 / 50)
    assert one(wall, "darkness", left=(grey(0), grey(0))) == 1


def test_frames_are_counted_from_the_start(wall: Case) -> None:
    assert conditions_of(wall)["since_start"].tolist() == [0, 1]


def test_a_short_step_is_one_over_its_length_and_a_stop_counts_a_tenth_of_the_median_step() -> None:
    positions_m = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.0, 0, 0], [1.0, 0, 0]])
    gt = Trajectory(np.arange(4) * STEP_NS, se3.transform(np.eye(3), positions_m))
    assert _inverse_steps(gt) == pytest.approx([2, 2, 2, 20])
    still = Trajectory(gt.t_ns, np.repeat(gt.T_world_frame[:1], 4, axis=0))
    assert _inverse_steps(still).tolist() == [0, 0, 0, 0]
