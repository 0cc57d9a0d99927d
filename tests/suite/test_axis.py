"""A rig whose lenses are in a calibration's file."""

import pytest

from vobench.errors import SuiteError
from vobench.runner.simulate import content

# A pair as KITTI has it: P = K [I | -K (0.5, 0, 0)], and a colour pair that is looked at where there is no grey one.
GREY = "P0: 700 0 600 0 0 710 180 0 0 0 1 0\nP1: 700 0 600 -350 0 710 180 0 0 0 1 0\n"
COLOUR = "P2: 600 0 600 60 0 600 180 0 0 0 1 0\nP3: 600 0 600 -240 0 600 180 0 0 0 1 0\n"
PINHOLES = """{pitch_deg: 0, own: {
  left: {size_px: [1241, 376], focal_px: [%s], center_px: [600, 180]}, right_at_m: [0.5, 0, 0]}}"""
CHAIN = """cam0:
  camera_model: pinhole
  intrinsics: [400, 401, 320, 200]
  distortion_model: radtan
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00001]
  resolution: [640, 400]
cam1:
  T_cn_cnm1: [[0, -1, 0, 0.02], [1, 0, 0, -0.11], [0, 0, 1, 0.01], [0, 0, 0, 1]]
  camera_model: pinhole
  intrinsics: [190, 191, 256, 250]
  distortion_model: equidistant
  distortion_coeffs: [0.003, 0.0007, -0.002, 0.0002]
  resolution: [640, 400]
"""
LENSES = """{pitch_deg: 5, baseline_m: 0.2, own: {
  left: {model: brown_conrady, size_px: [640, 400], focal_px: [400, 401], center_px: [320, 200],
    distortion: [-0.28, 0.07, 0.0002, 0.00001]},
  right: {model: kannala_brandt, size_px: [640, 400], focal_px: [190, 191], center_px: [256, 250],
    distortion: [0.003, 0.0007, -0.002, 0.0002]},
  right_at_m: [0.11, 0.02, -0.01], right_turned_deg: [0, 0, -90]}}"""


@pytest.mark.parametrize(
    ("text", "by_file", "by_keys"),
    [
        (GREY + COLOUR, "{pitch_deg: 0, calib: it}", PINHOLES % "700, 710"),
        (COLOUR, "{pitch_deg: 0, calib: it, size_px: [1241, 376]}", PINHOLES % "600, 600"),
        (CHAIN, "{pitch_deg: 5, baseline_m: 0.2, camchain: it}", LENSES),
    ],
)
def test_a_rig_of_a_file_is_the_rig_of_its_numbers(bent, tmp_path, text, by_file, by_keys):
    (tmp_path / "it").write_text(text)
    same = [bent(("{pitch_deg: 90}", rig)).simulated[0] for rig in (by_file, by_keys)]
    of_file, of_keys = (case.rig.build() for case in same)
    assert (of_file.left, of_file.right) == (of_keys.left, of_keys.right)
    assert of_file.T_left_right == pytest.approx(of_keys.T_left_right, abs=1e-12)
    assert content(same[0])["rig"]["calib"] is None  # where the file lies is no part of the case


CALIB, CAMCHAIN = "{pitch_deg: 0, calib: it}", "{pitch_deg: 0, camchain: it}"


@pytest.mark.parametrize(
    ("text", "rig", "wrong"),
    [
        (None, CALIB, "it"),
        (GREY.split("P1", maxsplit=1)[0], CALIB, "a pair needs P0 and P1, or P2 and P3; the file has P0"),
        (
            GREY.replace("600", "300"),
            CALIB,
            "it: P0 has its principal point at [300.0, 180.0], so images do not have KITTI",
        ),
        (CHAIN.split("cam1", maxsplit=1)[0], CAMCHAIN, "a pair of cameras needs cam1, which is missing in"),
        (CHAIN.replace("  resolution: [640, 400]\n", "", 1), CAMCHAIN, "it: the key cam0.resolution is missing"),
        (CHAIN, "{pitch_deg: 0, camchain: it, calib: it}", "camchain: gives the lenses, which calib gives"),
        (CHAIN, "{pitch_deg: 0, camchain: it, size_px: [4, 4]}", "size_px: requires calib"),
    ],
)
def test_what_a_file_lacks_is_said_with_its_name(bent, tmp_path, text, rig, wrong):
    if text:
        (tmp_path / "it").write_text(text)
    with pytest.raises(SuiteError, match=r"tiny.yaml:5: rigs.down") as error:
        bent(("{pitch_deg: 90}", rig))
    assert wrong in str(error.value)
