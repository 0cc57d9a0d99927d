import pytest

from vobench.dataset.distortion import focal_camera
from vobench.errors import InputError
from vobench.geometry.camera import BrownConrady, KannalaBrandt, Pinhole

SIZE = (64, 48)
FOCAL = [40.0, 41.0, 31.5, 23.5]


@pytest.mark.parametrize("name", ["radtan", " Radial-Tangential", "plumb_bob", "rational_polynomial", "none", ""])
@pytest.mark.parametrize("zeros", [0, 4, 5, 8])
def test_without_distortion_every_name_but_that_of_a_fisheye_is_a_pinhole(name: str, zeros: int) -> None:
    assert focal_camera(SIZE, FOCAL, name, [0.0] * zeros, place="x") == Pinhole(*SIZE, *FOCAL)


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_coefficients_behind_the_fifth_are_zero_or_refused(count: int) -> None:
    d = [0.1, -0.02, 1e-3, 2e-3, 5e-3][:count]
    padded = d + [0.0] * (count - len(d))
    assert focal_camera(SIZE, FOCAL, "radtan", padded, place="x") == BrownConrady(*SIZE, *FOCAL, *d)
    if count > 5:
        with pytest.raises(InputError, match="no camera model has the distortion model 'radtan'"):
            focal_camera(SIZE, FOCAL, "radtan", [*padded[:-1], 1e-9], place="x")


def test_a_fisheye_needs_four_coefficients_and_keeps_zeros() -> None:
    assert focal_camera(SIZE, FOCAL, "equi", [0.0] * 4, place="x") == KannalaBrandt(*SIZE, *FOCAL, 0.0, 0.0, 0.0, 0.0)
    d = [0.1, -0.02, 1e-3, 2e-3]
    assert focal_camera(SIZE, FOCAL, "EQUIDISTANT", d, place="x") == KannalaBrandt(*SIZE, *FOCAL, *d)
    with pytest.raises(InputError, match=r"^x: no camera model has the distortion model 'equi' with .*\[0\.1\]"):
        focal_camera(SIZE, FOCAL, "equi", [0.1], place="x")


@pytest.mark.parametrize("focal", [[0.0, 1.0, 1.0, 1.0], [1.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0] * 5])
def test_a_camera_has_two_focal_lengths_above_0_and_a_centre(focal: list[float]) -> None:
    with pytest.raises(InputError, match=r"^x: a camera should have fx, fy, cx, cy with fx and fy above 0, but has \["):
        focal_camera(SIZE, focal, "none", [], place="x")


def test_the_centre_may_lie_outside_the_picture() -> None:
    assert focal_camera(SIZE, [1.0, 1.0, -5.0, 0.0], "none", [], place="x").K[0, 2] == -5.0
