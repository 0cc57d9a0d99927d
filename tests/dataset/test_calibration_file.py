from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.dataset.calibration_file import MOST_BRACKETS, MOST_CHARACTERS, MOST_VALUE_CHARACTERS, read_yaml, shown
from vobench.dataset.calibration_value import AboveZero, Number, Numbers, Resolution, RigidTransform, Text, ZeroOrMore
from vobench.errors import InputError
from vobench.geometry import se3


@dataclass(frozen=True, slots=True)
class Keys:
    text: Text = ""
    number: Number = 0.0
    numbers: Numbers = ()
    above: AboveZero = 1.0
    least: ZeroOrMore = 0.0
    size: Resolution = (1.0, 1.0)
    pose: RigidTransform | None = None


@dataclass(frozen=True, slots=True)
class Needed:
    needed: Number


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "any.yaml"


def keys(path: Path, text: str) -> Keys:
    path.write_text(text, encoding="utf-8")
    return read_yaml(path).checked(Keys)


def complaint(path: Path, text: str) -> str:
    with pytest.raises(InputError) as caught:
        keys(path, text)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_values_of_the_right_kind_come_as_they_are_and_other_keys_are_ignored(path: Path) -> None:
    found = keys(
        path, "text: radtan\nnumber: -3\nnumbers: [1, 2.5]\nabove: 1e-5\nleast: 0\nsize: [752, 480.]\nx: [y]\n"
    )
    assert found == Keys("radtan", -3.0, (1.0, 2.5), 1e-5, 0.0, (752.0, 480.0))
    assert isinstance(found.number, float)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("text: 5", "text should be text (a number or a date needs quotes), but is 5"),
        ("number: five", "number should be a finite number, but is 'five'"),
        ("number: '5'", "number should be a finite number, but is '5'"),
        ("number: true", "number should be a finite number, but is True"),
        ("number: .inf", "number should be a finite number, but is inf"),
        ("number: 1e301", "number should be less than 1e+300, but is 1e+301"),
        ("number: -1e301", "number should be greater than -1e+300, but is -1e+301"),
        ("number:", "number should be a finite number, but is nothing"),
        ("numbers: 5", "numbers should be a list, as in [a, b], but is 5"),
        ("numbers: [1, .nan]", "numbers.1 should be a finite number, but is nan"),
        ("above: 0", "above should be greater than 0, but is 0"),
        ("least: -1e-9", "least should be 0 or more, but is -1e-09"),
        ("size: [752]", "size should have 2 or more entries, but is [752]"),
        ("size: [1, 2, 3]", "size should have 2 or fewer entries, but is [1, 2, 3]"),
        ("size: [0, 480]", "size.0 should be 1 or more, but is 0"),
        ("size: [752, 480.5]", "size.1 should be a whole number, but is 480.5"),
        ("size: [752, 100001]", "size.1 should be 100000 or less, but is 100001"),
        ("pose: [1, 2]", "pose should be a 4 x 4 matrix of finite numbers, but is [1, 2]"),
        ("pose: 7", "pose should be a 4 x 4 matrix of finite numbers, but is 7"),
    ],
)
def test_a_wrong_value_is_refused_by_file_key_and_value_and_by_what_would_be_right(
    path: Path, line: str, said: str
) -> None:
    assert complaint(path, line) == f"{path}: {said}"


def test_a_missing_key_is_named_beside_those_that_are_there(path: Path) -> None:
    path.write_text("cam0:\n  neded: 5\nother: 1\n", encoding="utf-8")
    file = read_yaml(path)
    with pytest.raises(InputError, match=r"any\.yaml: the key cam0\.needed is missing; the keys beside it are neded$"):
        file.checked(Needed, "cam0")
    with pytest.raises(InputError, match=r"the key needed is missing; the keys beside it are cam0, other$"):
        file.checked(Needed)
    with pytest.raises(InputError, match=r"the key cam1 is missing; the keys beside it are cam0, other$"):
        file.checked(Needed, "cam1")
    with pytest.raises(InputError, match=r": other should be keys with values, but is 1$"):
        file.checked(Needed, "other")


def test_a_key_without_a_value_is_as_good_as_none(path: Path) -> None:
    path.write_text("cam0:\ncam1: 0\n", encoding="utf-8")
    file = read_yaml(path)
    assert [file.has(name) for name in ("cam0", "cam1", "cam2")] == [False, True, False]


def test_a_transform_is_the_same_as_rows_as_cells_and_as_data_of_euroc(path: Path) -> None:
    T = se3.transform(Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix(), [0.1, 0.2, -0.3])
    flat = T.ravel().tolist()
    for text in (f"pose: {T.tolist()}", f"pose: {flat}", f"pose:\n  cols: 4\n  rows: 4\n  data: {flat}"):
        found = keys(path, text).pose
        assert found is not None
        np.testing.assert_allclose(found, T, rtol=0, atol=1e-15)


def test_a_rotation_of_few_digits_is_made_exact_and_one_that_is_none_refused(path: Path) -> None:
    R = Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix()
    rounded = se3.transform(np.round(R, 4), [1.0, 2.0, 3.0])
    found = keys(path, f"pose: {rounded.tolist()}").pose
    assert found is not None
    np.testing.assert_allclose(found[:3, :3].T @ found[:3, :3], np.eye(3), atol=1e-14)
    np.testing.assert_allclose(found[:3, :3], R, atol=1e-4)
    np.testing.assert_array_equal(found[:3, 3], [1, 2, 3])
    for wrong in (np.diag([1.0, 1.0, -1.0, 1.0]), np.diag([1.01, 1.0, 1.0, 1.0]), np.diag([1.0, 1.0, 1.0, 2.0])):
        said = complaint(path, f"pose: {wrong.tolist()}")
        assert "pose should be a rigid transform with the last row 0 0 0 1" in said


def test_a_head_of_opencv_is_passed_over_and_only_there(path: Path) -> None:
    assert keys(path, "%YAML:1.0\n---\nnumber: 5\n").number == 5
    assert "not valid YAML" in complaint(path, "number: 5\n%YAML:1.0\n: [")


def test_files_that_would_take_the_parser_long_are_refused_and_those_at_the_limit_read(path: Path) -> None:
    assert keys(path, "number: 5\n".ljust(MOST_CHARACTERS, "\n")).number == 5
    assert f"at most {MOST_CHARACTERS} characters" in complaint(path, "number: 5\n".ljust(MOST_CHARACTERS + 1, "\n"))
    lists = "\n".join(f"k{i}: []" for i in range(MOST_BRACKETS))
    assert keys(path, lists) == Keys()
    assert "at most 500 brackets, not 501" in complaint(path, lists + "\nmore: {}")


def test_a_mistake_of_yaml_has_its_line_and_column(path: Path) -> None:
    assert complaint(path, "a: 1\nb: [1, 2\nc: 3\n").startswith(f"{path}:3:2: not valid YAML: ")
    assert complaint(path, "a: &x 1\nb: *x\n") == f"{path}:2: a calibration may not use a YAML alias (*x)"
    assert complaint(path, "- 1\n") == f"{path}: should be keys with values, but is [1]"


def test_a_long_value_is_shortened_and_one_at_the_limit_is_not() -> None:
    assert shown(None) == "nothing"
    assert shown("a" * (MOST_VALUE_CHARACTERS - 2)) == repr("a" * (MOST_VALUE_CHARACTERS - 2))
    long = shown("a" * (MOST_VALUE_CHARACTERS - 1))
    assert len(long) == MOST_VALUE_CHARACTERS
    assert long.endswith("a...")
