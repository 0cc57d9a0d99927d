"""Changes of images have the size that they state."""

import cv2
import numpy as np
import pytest

from tests.analysis.pictures import HEIGHT_PX, WIDTH_PX, pair, view
from vobench.analysis.picture_change import (
    CHANGE_TEXTS,
    INSTEAD,
    Blur,
    Dirt,
    ExposureJumps,
    ImageSpot,
    MissingFrames,
    Noise,
    TurnedCamera,
    changed_picture,
    turned,
)

RNG = np.random.default_rng(0)


def grey() -> np.ndarray:
    return view(100, 0).astype(np.float32)


def test_every_change_has_words() -> None:
    assert set(INSTEAD) == set(CHANGE_TEXTS)


@pytest.mark.parametrize(("axis", "x_axis"), [("yaw", 1), ("pitch", 0), ("roll", 2)])
def test_a_rotation_shifts_points_as_the_exact_one_does(axis: str, x_axis: int) -> None:
    index = ("roll", "pitch", "yaw").index(axis)
    angles_deg = np.zeros(3)
    angles_deg[index] = 0.5
    K = pair().K
    # A camera that turns to the right, upwards or clockwise moves points to the left, downwards or anticlockwise.
    sign = {"yaw": -1, "pitch": -1, "roll": -1}[axis]
    vector = np.zeros(3)
    vector[x_axis] = sign * np.deg2rad(0.5)
    H = K @ cv2.Rodrigues(vector)[0] @ np.linalg.inv(K)
    exact = cv2.warpPerspective(grey(), H, (WIDTH_PX, HEIGHT_PX), flags=cv2.INTER_CUBIC)
    inner = (slice(10, -10), slice(10, -10))
    difference = np.abs(turned(grey(), angles_deg, pair()) - exact)[inner].mean()
    assert difference < 0.15 * np.abs(grey() - exact)[inner].mean()


def test_noise_and_blur_have_their_size() -> None:
    flat = np.full((100, 100), 128, np.float32)
    noise = Noise("", np.array([[3.0, 6.0]]))
    assert noise.applied(flat, ImageSpot(0, 0, RNG)).std() == pytest.approx(3, rel=0.05)
    assert noise.applied(flat, ImageSpot(0, 1, RNG)).std() == pytest.approx(6, rel=0.05)

    point = np.zeros((41, 41), np.float32)
    point[20, 20] = 1
    spread = Blur("", np.array([[0.0, 2.0]])).applied(point, ImageSpot(0, 1, RNG))
    columns = np.arange(41) - 20
    assert np.sqrt((spread.sum(0) * columns**2).sum()) == pytest.approx(2, rel=0.05)
    assert (Blur("", np.array([[0.0, 2.0]])).applied(point, ImageSpot(0, 0, RNG)) == point).all()


def test_an_exposure_scales_grey_values_and_saturates() -> None:
    jumps = ExposureJumps("", np.array([[1.0, -1.0]]))
    values = np.array([[10, 200]], np.float32)
    assert jumps.applied(values, ImageSpot(0, 0, RNG)).tolist() == [[20, 255]]
    assert jumps.applied(values, ImageSpot(0, 1, RNG)).tolist() == [[5, 100]]


def test_dirt_is_put_into_dirty_frames_alone() -> None:
    dirt = Dirt("", np.array([[True, False]]), np.full((2, 4, 4), 0.5), np.full((2, 4, 4), 7.0))
    values = np.full((4, 4), 100, np.float32)
    assert (dirt.applied(values, ImageSpot(0, 0, RNG)) == 57).all()
    assert (dirt.applied(values, ImageSpot(0, 1, RNG)) == 100).all()


def test_a_turned_camera_leaves_the_left_image() -> None:
    camera = TurnedCamera("", np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]), pair())
    assert (camera.applied(grey(), ImageSpot(0, 0, RNG)) == grey()).all()
    assert (camera.applied(grey(), ImageSpot(1, 1, RNG)) == grey()).all()
    assert (camera.applied(grey(), ImageSpot(0, 1, RNG)) != grey()).any()


def test_an_image_without_changes_has_the_usual_noise_of_its_seed() -> None:
    flat = np.full((100, 100), 128, np.uint8)

    def image(seed: int) -> np.ndarray:
        rng = np.random.default_rng(seed)
        return changed_picture(flat, [MissingFrames("")], ImageSpot(0, 0, rng), noise_dn=2.0)

    assert image(1).std() == pytest.approx(2, rel=0.05)
    assert (image(1) == image(1)).all()
    assert (image(1) != image(2)).any()


def test_noise_is_added_after_the_exposure_and_the_blur() -> None:
    flat = np.full((100, 100), 128, np.uint8)
    changes = [
        Noise("", np.array([[4.0, 4.0]])),
        ExposureJumps("", np.array([[-2.0, -2.0]])),
        Blur("", np.full((1, 2), 3.0)),
    ]
    image = changed_picture(flat, changes, ImageSpot(0, 0, np.random.default_rng(0)), noise_dn=0.0)
    assert image.mean() == pytest.approx(32, abs=0.3)
    assert image.std() == pytest.approx(4, rel=0.05)
