"""A patch contains the points of its rotated rectangle, and patches that overlap act together."""

import numpy as np
import pytest

from vobench.errors import SettingError
from vobench.geometry import se3
from vobench.motion.floor_patch import SURFACES, FloorPatch, GroundSlip, ground_effect

Pair = tuple[float, float]
FAR = ((9.0, 9.0), (1.0, 1.0))


@pytest.fixture(autouse=True)
def _grounds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SURFACES, "doubly biased", GroundSlip(2.0, 0.01, -0.01))
    monkeypatch.setitem(SURFACES, "triply biased", GroundSlip(3.0, 0.02, -0.02))


def patch_of(surface: str, center_m: Pair, size_m: Pair, yaw_deg: float = 0.0) -> FloorPatch:
    return FloorPatch(surface=surface, center_m=center_m, size_m=size_m, yaw_deg=yaw_deg)


def test_a_patch_holds_the_points_inside_its_turned_rectangle() -> None:
    patch = patch_of("wet", (1.0, 2.0), (2.0, 0.2), 90)
    assert [patch.contains(1.05, y) for y in (1.01, 2.99, 3.01)] == [True, True, False]
    assert not patch.contains(1.11, 2.0)


def test_a_patch_turns_with_its_yaw_about_its_center() -> None:
    flat, turned = (patch_of("wet", (1.0, 2.0), (2.0, 0.5), yaw_deg) for yaw_deg in (0, 40))
    R = se3.rotation_z(np.deg2rad(40))[:2, :2]
    for offset in np.random.default_rng(0).uniform(-1.5, 1.5, (200, 2)):
        assert turned.contains(*np.add(R @ offset, [1, 2]).tolist()) == flat.contains(*np.add(offset, [1, 2]).tolist())


def test_where_patches_overlap_factors_multiply_and_biases_add() -> None:
    patches = [patch_of(f"{times} biased", (0.0, 0.0), (1.0, 1.0)) for times in ("doubly", "triply")]
    assert ground_effect(patches, 0.2, 0.2) == (6.0, pytest.approx(0.03), pytest.approx(-0.03))
    assert ground_effect(patches, 0.6, 0.2) == (1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: GroundSlip(factor=-1.0), "factor: should be 0 or more"),
        (lambda: GroundSlip(ratio_bias=float("nan")), "ratio_bias: should be a finite number"),
        (lambda: patch_of("wett", *FAR), "surface: no surface named 'wett'. Did you mean 'wet'"),
        (lambda: patch_of("wet", (0.0, float("nan")), (1.0, 1.0)), r"center_m\.1: should be a finite number"),
        (lambda: patch_of("wet", (0.0, 0.0), (1.0, 0.0)), r"size_m\.1: should be greater than 0"),
    ],
)
def test_what_is_no_floor_is_refused(make: object, sentence: str) -> None:
    with pytest.raises(SettingError, match=sentence):
        make()
