import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vobench.dataset.export import export
from vobench.dataset.photometric import camera_text
from vobench.dataset.read_back import known_points
from vobench.dataset.rectified_view import rectified
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, Camera, DoubleSphere, pixel_grid
from vobench.geometry.rig import PRESETS, Rig
from vobench.sensor.exposure import Exposure
from vobench.sensor.image_sensor import CAMERAS, CameraSensor, CameraSettings, NoiseStreams, expose

Make = Callable[..., Any]


def case_json(**camera: object) -> bytes:
    said = {"sensor": "clean", "chip": {}, "vignetting": 0.0, "vignetting_cutoff_deg": None, "dirt": 0.0, **camera}
    return json.dumps({"camera": said}).encode()


def dso_pixels(text: str, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where DSO sees points by its camera.txt, as its readme and its Undistort classes put it, on its own grid."""
    model, *numbers = text.splitlines()[0].split()
    (fx, fy, cx, cy, *d), (width, height) = map(float, numbers), map(int, text.splitlines()[1].split())
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    r2 = x * x + y * y
    if model == "RadTan":
        k1, k2, r1, r_2 = d
        bent = k1 * r2 + k2 * r2 * r2
        x, y = (
            x + x * bent + 2 * r1 * x * y + r_2 * (r2 + 2 * x * x),
            y + y * bent + 2 * r_2 * x * y + r1 * (r2 + 2 * y * y),
        )
    elif model == "EquiDistant":
        r = np.sqrt(r2)
        t = np.arctan(r)
        scale = t * (1 + d[0] * t**2 + d[1] * t**4 + d[2] * t**6 + d[3] * t**8) / np.maximum(r, 1e-12)
        x, y = x * scale, y * scale
    else:
        assert (model, d) == ("Pinhole", [0.0])
    return np.stack([fx * width * x + cx * width - 0.5, fy * height * y + cy * height - 0.5], -1)


@pytest.mark.parametrize("name", ["paper_literal", "euroc", "fisheye"])
def test_dso_sees_points_where_the_camera_does(name: str) -> None:
    camera: Camera = PRESETS[name].left
    points = known_points(camera)
    points = points[points[:, 2] > 0.1 * np.linalg.norm(points, axis=1)]
    text = camera_text(camera)
    assert text
    np.testing.assert_allclose(dso_pixels(text, points), camera.project(points), atol=1e-8)


def test_a_lens_that_dso_has_no_model_for_has_no_camera_file() -> None:
    assert camera_text(DoubleSphere(64, 64, 20.0, 20.0, 31.5, 31.5, -0.2, 0.6)) is None
    assert camera_text(BrownConrady(64, 48, 50.0, 50.0, 31.5, 23.5, -0.1, 0.01, k3=0.003)) is None


@pytest.mark.parametrize("response", [None, "linear", "srgb", 2.2, [0.0, 0.1, 0.4, 1.0]])
def test_the_inverse_response_takes_grey_values_back_to_light(
    response: object, make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(case_json=case_json(chip={"response": response}))
    export(made.folder, tmp_path / "out", "euroc")
    inverse = np.array((tmp_path / "out/photometric/cam0/pcalib.txt").read_text().split(), float)
    assert inverse.shape == (256,)
    assert (inverse[0], inverse[-1]) == (0, 255)
    assert (np.diff(inverse) > 0).all()
    if response == 2.2:
        np.testing.assert_allclose(inverse, 255 * (np.arange(256) / 255) ** 2.2, atol=1e-12)


def test_a_grey_value_through_the_inverse_response_is_proportional_to_exposure(
    make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(case_json=case_json(chip={"response": 2.2}))
    export(made.folder, tmp_path / "out", "euroc")
    inverse = np.array((tmp_path / "out/photometric/cam1/pcalib.txt").read_text().split(), float)
    camera = CameraSettings(chip=CameraSensor(response=2.2))
    radiance = np.linspace(0.1, 0.7, 400, dtype=np.float32)[None]
    rng = np.random.default_rng(0)
    once, twice = (
        expose(radiance, camera, NoiseStreams(rng, rng), exposure=Exposure(time_s)) for time_s in (0.0025, 0.005)
    )
    np.testing.assert_allclose(inverse[twice] / inverse[once], 2.0, rtol=0.06)


def shade_in(folder: Path, cam: str) -> NDArray[np.float64]:
    stored = cv2.imread(str(folder / f"photometric/{cam}/vignette.png"), cv2.IMREAD_UNCHANGED)
    assert (stored.dtype, stored.max()) == (np.uint16, 65535)
    return stored / 65535


def test_the_vignette_is_cos4_of_the_angle_to_the_axis(make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence(case_json=case_json(vignetting=1.0))
    export(made.folder, tmp_path / "out", "euroc")
    rays = made.rig.left.rays(pixel_grid(made.rig.left))
    np.testing.assert_allclose(
        shade_in(tmp_path / "out", "cam0"), rays[..., 2] ** 4 / (rays[..., 2] ** 4).max(), atol=1e-5
    )


def test_the_vignette_moves_with_the_pixels_of_a_rectified_pair(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    squint = se3.transform(Rotation.from_rotvec([0.05, -0.12, 0.02]).as_matrix(), [0.1, 0.0, 0.0])
    made = make_sequence(rig_of(T_left_right=squint), case_json=case_json(vignetting=1.0))
    for form in ("euroc", "kitti"):
        export(made.folder, tmp_path / form, form)
    for side, cam in (("left", "cam0"), ("right", "cam1")):
        before, after = (shade_in(tmp_path / form, cam) for form in ("euroc", "kitti"))
        assert np.abs(before - after).max() > 0.02, "or nothing moved"
        u, v = np.moveaxis(rectified(made.rig).source_px[side].astype(np.float32), -1, 0)
        moved = cv2.remap(before.astype(np.float32), u, v, cv2.INTER_LINEAR, borderValue=np.nan)
        ratio = (after / moved)[np.isfinite(moved)]
        assert np.ptp(ratio) < 0.01, "the same but for the scale, which is each image's own"


def test_exposures_are_in_milliseconds_by_number_and_stamp(make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence()
    notes = export(made.folder, tmp_path / "out", "tum").notes
    rows = [line.split() for line in (tmp_path / "out/photometric/cam0/times.txt").read_text().splitlines()]
    assert [row[0] for row in rows] == ["00000", "00001", "00002", "00003", "00004"]
    assert [int(row[1].replace(".", "")) for row in rows] == made.t_ns.tolist()
    np.testing.assert_allclose([float(row[2]) for row in rows], [2.0, 5.0, 12.5, 4.0, 3.0], rtol=1e-12)
    assert any("constant at 6 dB" in note for note in notes)


def test_what_is_not_known_is_not_written_and_said(make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence(case_json=None, exposures=())
    exported = export(made.folder, tmp_path / "out", "euroc")
    assert not any(name.endswith(("pcalib.txt", "vignette.png")) for name in exported.files)
    assert all(
        len(line.split()) == 2 for line in (tmp_path / "out/photometric/cam0/times.txt").read_text().splitlines()
    )
    assert any("not known: there is no pcalib.txt" in note for note in exported.notes)
    assert any("The exposure of some images is not known" in note for note in exported.notes)


def test_black_level_and_dirt_are_said(make_sequence: Make, tmp_path: Path) -> None:
    assert "mt9v034" in CAMERAS
    made = make_sequence(case_json=case_json(sensor="mt9v034", chip={"black_dn": 6.0}, dirt=0.1))
    notes = export(made.folder, tmp_path / "out", "euroc").notes
    assert any("6 grey values" in note for note in notes)
    assert any("dirt" in note for note in notes)


@pytest.mark.parametrize(
    "case", [b"[1]", b'{"camera": {}}', b'{"camera": {"sensor": "clean", "chip": {"response": [1]}}}']
)
def test_a_case_of_another_make_is_as_good_as_none(case: bytes, make_sequence: Make, tmp_path: Path) -> None:
    notes = export(make_sequence(case_json=case).folder, tmp_path / "out", "euroc").notes
    assert any("not known: there is no pcalib.txt" in note for note in notes)


def test_a_rolling_shutter_is_said(make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence(case_json=case_json(shutter="rolling", readout_ms=18.5))
    assert any("18.5 ms" in note for note in export(made.folder, tmp_path / "out", "tum").notes)
