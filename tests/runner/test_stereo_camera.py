"""When, from where and how long each row sees, and what the exposure loop makes of it; light by a stand-in."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.rendering.renderer import Radiance, View
from vobench.runner.motion import body_motion
from vobench.runner.stereo_camera import Displacement, StereoCamera, World
from vobench.scene.material import LUMINANCE, Material, Rgb
from vobench.scene.mesh import flat_shaded
from vobench.scene.scene import Mover, Scene, WaypointMotion
from vobench.scene.triangles import Thing
from vobench.suite.case import Case
from vobench.suite.suite import read_plan

WHITE_CD_M2 = 50
SCENE = """name: cell
white_cd_m2: 50
materials: {m: {pattern: plain, albedo: 0.5, resolution_px: 8}}
room: {size_m: [6, 6, 3], floor: m, wall: m, ceiling: m}
lamps: [{name: lamp, center_m: [0, 0, 2.9], size_m: [0.4, 0.4], power_lm: 600}]
"""
SUITE = """name: one
scenes: [cell]
rigs: {down: {pitch_deg: 90}}
trajectories: {way: {targets_m: [[1.5, 0]], slip: none}}
cameras: {it: CAMERA}
lightings: {it: LIGHTING}
estimators: [stand_still]
"""


class Recorder:
    """A renderer of even light that remembers what it was asked for."""

    def __init__(self, luminance_cd_m2: float = WHITE_CD_M2) -> None:
        self.luminance_cd_m2, self.asked = luminance_cd_m2, list[Sequence[View]]()

    def radiance(self, camera: Camera, views: Sequence[View], *, weights: Rgb | None = None) -> Radiance:
        self.asked.append(views)
        assert weights == LUMINANCE
        return np.full((camera.height_px, camera.width_px), self.luminance_cd_m2, np.float32)

    def close(self) -> None:
        pass


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The case of one camera and lighting, given in YAML."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "cell.yaml").write_text(SCENE)

    def read(camera: str = "{}", lighting: str = "{}") -> Case:
        text = SUITE.replace("CAMERA", camera).replace("LIGHTING", lighting)
        (tmp_path / "one.yaml").write_text(text)
        return read_plan("./one.yaml").cases[0]

    return read


def shot(case: Case, renderer: Recorder, t_ns: int = 2_000_000_000):
    """The views of the left picture taken at a time, and where the body was, as a function."""
    scene, motion = case.build_scene(), body_motion(case).motion
    StereoCamera(case, World(scene, renderer, motion, 50.0)).shoot(t_ns)
    return renderer.asked[0], lambda t_ns: motion.at(t_ns).T_world_body


def test_a_plain_camera_sees_once_from_where_the_stamp_is(case) -> None:
    plain = case("{exposure_ms: 4}")
    views, path = shot(plain, Recorder())
    (view,) = views
    assert (view.rows, view.start_ns.tolist(), view.end_ns.tolist()) == (
        slice(0, 480),
        [1_998_000_000],
        [2_002_000_000],
    )
    left = path(np.array([2_000_000_000])) @ plain.build_rig().T_body_left
    np.testing.assert_array_equal(view.T_world_camera, left)


def test_both_eyes_expose_the_same_time_from_their_own_place(case) -> None:
    renderer = Recorder()
    rig = case().build_rig()
    shot(case(), renderer)
    (left,), (right,) = renderer.asked
    np.testing.assert_array_equal(left.start_ns, right.start_ns)
    np.testing.assert_allclose(
        se3.inverse(left.T_world_camera[0]) @ right.T_world_camera[0], rig.T_left_right, atol=1e-12
    )


def test_blur_takes_a_sub_frame_for_every_pixel_that_the_floor_moves(case) -> None:
    views, path = shot(case("{exposure_ms: 20, motion_blur: true}"), Recorder())
    (view,) = views
    first, last = path(np.array([1_990_000_000, 2_010_000_000]))
    moved_px = 658.3 / 0.4 * np.linalg.norm((last - first)[:3, 3])
    assert moved_px > 4
    assert len(view.start_ns) == pytest.approx(moved_px, abs=1.5)
    assert (view.start_ns[0], view.end_ns[-1]) == (1_990_000_000, 2_010_000_000)
    np.testing.assert_array_equal(view.start_ns[1:], view.end_ns[:-1])
    middles = view.start_ns + (view.end_ns - view.start_ns) // 2
    np.testing.assert_allclose(
        se3.inverse(path(middles)) @ view.T_world_camera,
        case().build_rig().T_body_left[None] + 0 * view.T_world_camera,
        atol=1e-12,
    )


def test_a_rolling_shutter_sees_each_strip_when_its_rows_are_read(case) -> None:
    views, path = shot(case("{exposure_ms: 1, shutter: rolling, readout_ms: 30}"), Recorder())
    assert [v.rows.start for v in views[1:]] == [v.rows.stop for v in views[:-1]]
    assert (views[0].rows.start, views[-1].rows.stop) == (0, 480)
    assert len(views) > 10
    for view in views:
        middle_row = (view.rows.start + view.rows.stop) / 2
        late_ns = (middle_row - 240) / 480 * 30e6
        assert view.start_ns[0] + 500_000 == pytest.approx(2_000_000_000 + late_ns, abs=2)
        body = view.T_world_camera[0] @ se3.inverse(case().build_rig().T_body_left)
        np.testing.assert_allclose(body, path(view.start_ns + 500_000)[0], atol=1e-9)


def test_under_changing_light_strips_of_a_rolling_shutter_are_thin(case) -> None:
    flicker = "{lamp: {level: {flicker: {depth: 0.5}}}}"
    views, _ = shot(case("{shutter: rolling, readout_ms: 30}", flicker), Recorder(), t_ns=0)
    assert {v.rows.stop - v.rows.start for v in views} == {4}


def settled(case: Case, luminance_cd_m2: float, frames: int) -> list[float]:
    """Shares of full scale of the left picture's mean, frame after frame."""
    scene, motion = case.build_scene(), body_motion(case).motion
    camera = StereoCamera(case, World(scene, Recorder(luminance_cd_m2), motion, WHITE_CD_M2))
    chip = case.camera.chip
    return [float(chip.signal_of_grey[camera.shoot(t).left].mean()) for t in range(frames)]


@pytest.mark.parametrize("factor", [1 / 16, 16])
def test_auto_exposure_settles_within_ten_frames_and_both_eyes_follow(case, factor) -> None:
    shares = settled(
        case("{exposure_ms: 2, auto_exposure: {target_share: 0.18, t_min_ms: 0.01, gain_max_db: 24}}"),
        WHITE_CD_M2 * factor,
        14,
    )
    assert shares[9:] == pytest.approx([0.18] * 5, rel=0.03)


def test_without_a_loop_a_brighter_scene_is_a_brighter_picture(case) -> None:
    dark, bright = (settled(case(), WHITE_CD_M2 * factor, 1)[0] for factor in (0.25, 0.5))
    assert bright == pytest.approx(2 * dark, rel=0.03)


class TestDisplacement:
    """The largest motion in a picture, against geometry."""

    def test_over_a_floor_it_is_focal_length_times_way_over_height(self, case) -> None:
        rig, scene = case().build_rig(), case().build_scene()
        last = se3.transform(np.eye(3), [0.01, 0, 0]) @ rig.T_body_left
        largest = Displacement(scene).largest_px(rig.left, rig.T_body_left, last, start_ns=0, end_ns=1)
        assert largest == pytest.approx(658.2857 / 0.4 * 0.01, rel=1e-4)

    def test_without_motion_there_is_none(self, case) -> None:
        rig, scene = case().build_rig(), case().build_scene()
        assert Displacement(scene).largest_px(rig.left, rig.T_body_left, rig.T_body_left, start_ns=0, end_ns=1) == 0

    def test_what_the_last_pose_sees_nothing_of_has_not_moved(self, case) -> None:
        rig, scene = case().build_rig(), case().build_scene()
        away = rig.T_body_left @ se3.transform(np.diag([-1.0, 1.0, -1.0]), [0, 0, 0])
        assert Displacement(scene).largest_px(rig.left, rig.T_body_left, away, start_ns=0, end_ns=1) == 0

    def test_a_mover_counts_while_the_camera_stands(self, case, tmp_path) -> None:
        keys = "{t_s: 0, position_m: [0.25, 0, 0.1]}, {t_s: 1, position_m: [0.25, 0.1, 0.1]}"
        mover = f"movers: [{{name: cart, size_m: [0.2, 0.2, 0.2], material: m, path: [{keys}]}}]\n"
        (tmp_path / "scenes" / "cell.yaml").write_text(SCENE + mover)
        moving, rig = case(), case().build_rig()
        largest = Displacement(moving.build_scene()).largest_px(
            rig.left, rig.T_body_left, rig.T_body_left, start_ns=0, end_ns=100_000_000
        )
        assert largest == pytest.approx(658.2857 / (0.4 - 0.2) * 0.01, rel=1e-4)


def test_a_face_of_a_mover_moves_in_the_picture_of_a_camera_at_rest() -> None:
    """The scene has one face alone, so that no other one hides that it is taken for a stationary one."""
    corners_m = np.array([[-3.0, -3.0, 2.0], [3.0, -3.0, 2.0], [0.0, 5.0, 2.0]])
    face = Thing("face", flat_shaded(corners_m, [[0, 2, 1]], np.zeros((3, 2))), "grey")
    across = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), np.zeros(2))
    scene = Scene("one face", (), {"grey": Material()}, (), (Mover("mover", (face,), across),))
    camera = Pinhole(64, 48, 100.0, 100.0, 31.5, 23.5)
    moved_px = Displacement(scene).largest_px(camera, np.eye(4), np.eye(4), start_ns=0, end_ns=10**9)
    assert moved_px == pytest.approx(100.0 * 0.1 / 2.0)
