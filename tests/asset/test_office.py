"""Furniture of offices: on the floor, light in faces, within the sizes that rooms reserve."""

import numpy as np
import pytest

from vobench.asset import office
from vobench.asset.furniture import Part


def box_of(parts: list[Part]) -> tuple[np.ndarray, np.ndarray]:
    corners = np.concatenate([part.arrays.vertices_m for part in parts])
    return corners.min(axis=0), corners.max(axis=0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "make",
    [office.task_chair, office.plain_desk, office.pedestal, office.copier, office.meeting_table, office.coat_stand],
)
def test_a_piece_stands_on_the_floor_with_few_faces(make, seed) -> None:  # type: ignore[no-untyped-def]
    parts = make(np.random.default_rng(seed))
    low, _ = box_of(parts)
    assert low[2] == pytest.approx(0, abs=0.004)
    assert sum(len(part.arrays.faces) for part in parts) < 1700


def test_a_chair_behind_a_desk_does_not_reach_its_pedestal() -> None:
    for seed in range(12):
        low, high = box_of(office.task_chair(np.random.default_rng(seed)))
        assert np.abs([low[:2], high[:2]]).max() < 0.345


def test_glazing_fills_its_hole_and_can_be_seen_through() -> None:
    parts = office.glazing(np.random.default_rng(0), 2.4, 1.9)
    low, high = box_of(parts)
    np.testing.assert_allclose(high[1:] - low[1:], [2.4, 1.9], atol=1e-9)
    assert any(part.material.kind == "pane" for part in parts)


def test_a_laptop_shines_from_its_screen() -> None:
    parts = office.laptop(np.random.default_rng(0))
    assert sum(part.material.emission_texture is not None for part in parts) == 1
