"""A model of an unlikely size, and a place that probably lies on its side, are reported; others are not."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.asset.glb import Reader, triangle
from vobench.asset.model import Model, read_model


@pytest.mark.parametrize(("scale", "note"), [(4300, "spans 4,300 m: in millimetres? scale: 0.001"), (0.004, "0.004 m")])
def test_a_model_of_an_unlikely_size_is_doubted_aloud(read: Reader, scale: float, note: str) -> None:
    assert note in read(triangle(), scale=scale).notes[-1]
    assert read(triangle()).notes == ()


def test_a_place_that_lies_on_its_side_is_doubted_aloud(read: Reader) -> None:
    floor = triangle(nodes=[{"scale": [20, 20, 20]}])  # its corners are of one height only where z is up
    (note,) = read(floor).notes
    assert re.fullmatch(
        r"probably lies on its side\. It is read with y up; if z is up, say so in a scene's YAML: "
        r"meshes: \[\{file: \S+\.gl(b|tf), up: z\}\]",
        note,
    )
    assert read(floor, up="z").notes == ()


HALL_M = (8.0, 7.66, 2.5)


def box(size_m: Sequence[float], center_m: Sequence[float]) -> trimesh.Trimesh:
    return trimesh.creation.box(size_m, trimesh.transformations.translation_matrix(center_m))


def furnished_hall(*, with_walls: bool) -> trimesh.Scene:
    """A floor, maybe four walls, tables, and cupboards up to the ceiling, with z up as in CAD."""
    length, width, height = HALL_M
    parts = [box((length, width, 0.02), (0, 0, -0.01))]
    if with_walls:
        parts += [box((length, 0.02, height), (0, side * (width / 2 - 0.01), height / 2)) for side in (-1, 1)]
        parts += [box((0.02, width, height), (side * (length / 2 - 0.01), 0, height / 2)) for side in (-1, 1)]
    for x in (-2.0, 0.0, 2.0):
        parts.append(box((1.6, 0.8, 0.04), (x, 1, 0.73)))
        parts += [box((0.05, 0.05, 0.71), (x + dx, 1 + dy, 0.355)) for dx in (-0.7, 0.7) for dy in (-0.35, 0.35)]
        parts += [box((0.8, 0.5, height), (x, y, height / 2)) for y in (-3, -1, 3)]
    return trimesh.Scene(parts)


@pytest.mark.parametrize("with_walls", [True, False])
@pytest.mark.parametrize("suffix", [".glb", ".stl"])
def test_a_hall_that_was_exported_with_the_wrong_axis_up_is_doubted_and_one_with_the_right_is_not(
    tmp_path: Path, suffix: str, with_walls: bool
) -> None:
    axis_by_format = {".glb": "y", ".stl": "z"}
    read_as_up = axis_by_format[suffix]
    hall = furnished_hall(with_walls=with_walls)
    lying = hall.copy()
    to_y_up = trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0])
    (hall if read_as_up == "y" else lying).apply_transform(to_y_up)
    path = tmp_path / f"hall{suffix}"

    hall.export(path)
    upright = read_model(path)
    np.testing.assert_allclose(np.ptp(points_of(upright), axis=0), (8, 7.66, 2.52), atol=1e-6)
    assert "on its side" not in " ".join(upright.notes)

    lying.export(path)
    other = "z" if read_as_up == "y" else "y"
    doubt = f"if {other} is up, say so in a scene's YAML: meshes: [{{file: hall{suffix}, up: {other}}}]"
    assert doubt in " ".join(read_model(path).notes)

    mended = read_model(path, up=other)
    np.testing.assert_allclose(np.ptp(points_of(mended), axis=0), (8, 7.66, 2.52), atol=1e-6)
    assert "on its side" not in " ".join(mended.notes)


def points_of(model: Model) -> np.ndarray:
    return np.concatenate([thing.mesh.vertices for thing in model.all_things])


def test_a_corridor_that_is_higher_than_wide_is_not_doubted(tmp_path: Path) -> None:
    corridor = box((24.0, 2.8, 2.6), (0, 1.4, 0))  # y up: 24 m long, 2.8 m high
    path = tmp_path / "corridor.glb"
    trimesh.Scene([corridor]).export(path)
    assert "on its side" not in " ".join(read_model(path).notes)
