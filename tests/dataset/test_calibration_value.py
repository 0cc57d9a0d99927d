"""A matrix in a calibration file is read from any of its forms, and is a rigid transform."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from vobench.dataset.calibration_value import RigidTransform
from vobench.geometry import se3

T = se3.transform(se3.rotation_z(0.5), [1.0, -2.0, 3.0])
ADAPTER = TypeAdapter(RigidTransform)


@pytest.mark.parametrize(
    "value", [T.tolist(), T.ravel().tolist(), {"cols": 4, "data": T.ravel().tolist()}, [*T[:3].tolist(), 0, 0, 0, 1]]
)
def test_rows_cells_and_a_mapping_are_the_same_transform(value: object) -> None:
    np.testing.assert_allclose(ADAPTER.validate_python(value), T, atol=1e-15)


def test_the_rotation_is_projected() -> None:
    rounded = np.round(T, 4)
    read = ADAPTER.validate_python(rounded.tolist())
    assert se3.is_rotation(read[:3, :3], tolerance=1e-15)
    np.testing.assert_allclose(read, T, atol=1e-4)


@pytest.mark.parametrize("value", ["1", None, T[:3].tolist(), [[True] * 4] * 4, [["1"] * 4] * 4, [[np.inf] * 4] * 4])
def test_what_is_no_matrix_of_finite_numbers_is_refused(value: object) -> None:
    with pytest.raises(ValidationError, match="should be a 4 x 4 matrix of finite numbers"):
        ADAPTER.validate_python(value)


@pytest.mark.parametrize("value", [np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([1.0, 1.0, 1.0, 2.0])])
def test_a_mirror_or_another_last_row_is_refused(value: np.ndarray) -> None:
    with pytest.raises(ValidationError, match="should be a rigid transform with the last row 0 0 0 1"):
        ADAPTER.validate_python(value.tolist())
