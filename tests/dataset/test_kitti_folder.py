"""Names in KITTI's folders, and the axes of its body."""

import numpy as np

from vobench.dataset.kitti_folder import COLOUR_PAIR, GREY_PAIR, PAIRS, T_BODY_GREY, matrix_name


def test_each_camera_has_the_projection_matrix_of_its_number() -> None:
    names = [matrix_name(folder) for folder in (*GREY_PAIR, *COLOUR_PAIR)]
    assert names == ["P0", "P1", "P2", "P3"]


def test_grey_pairs_are_preferred() -> None:
    assert PAIRS[0] == ("image_0", "image_1")


def test_the_camera_looks_along_x_of_the_body_with_z_up() -> None:
    R_body_grey = T_BODY_GREY[:3, :3]
    np.testing.assert_allclose(R_body_grey @ [0, 0, 1], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(R_body_grey @ [1, 0, 0], [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(R_body_grey @ [0, 1, 0], [0, 0, -1], atol=1e-12)
    np.testing.assert_array_equal(T_BODY_GREY[:3, 3], 0)
