"""Presets have the figures that their sources print, and stand as a stereo pair should."""

from pathlib import Path

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.preset import PRESETS, StereoPreset
from vobench.geometry.rig import LENSES, mounted, stereo_rig

# Fields of view across and down, and baselines, as their makers state them.
VIEWS_DEG = {"d435i": (89.56, 58.64), "zed2i": (110.0, 70.0), "tartanair": (90.0, 73.74)}
BASELINES_M = {"euroc": 0.110, "d435i": 0.050, "zed2i": 0.12, "tartanair": 0.25, "fisheye": 0.101}

every_preset = pytest.mark.parametrize("preset", PRESETS.values(), ids=list(PRESETS))


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
    new = mounted(preset.left, preset.right, preset.at_baseline(0.12), pitch_deg=33.3)
    assert (new.left, new.right) == (old.left, old.right)
    assert new.T_body_right.tobytes() == old.T_body_right.tobytes()


@every_preset
def test_a_preset_names_its_source(preset: StereoPreset) -> None:
    assert len(preset.source) > 20


def test_the_page_about_rigs_lists_every_preset() -> None:
    page = (Path(__file__).parents[2] / "docs" / "rigs.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    assert set(PRESETS) <= {row.strip(" `") for row in rows}
