"""Bathrooms: pieces stand at their wall, within the sizes that their rooms reserve for them."""

import numpy as np
import pytest

from vobench.asset import bathroom
from vobench.asset.furniture import Part


def box_of(parts: list[Part]) -> tuple[np.ndarray, np.ndarray]:
    corners = np.concatenate([part.arrays.vertices_m for part in parts])
    return corners.min(axis=0), corners.max(axis=0)


@pytest.mark.parametrize(
    ("make", "depth_m", "width_m", "low_m"),
    [
        (bathroom.bathtub, 0.76, 1.7, 0.0),
        (bathroom.shower, 0.92, 0.92, 0.0),
        (bathroom.washbasin, 0.5, 0.68, 0.36),
        (bathroom.toilet, 0.58, 0.42, 0.1),
    ],
)
def test_a_piece_keeps_to_its_place_at_the_wall(make, depth_m, width_m, low_m) -> None:  # type: ignore[no-untyped-def]
    low, high = box_of(make(np.random.default_rng(0)))
    assert low[0] >= -0.011
    assert high[0] <= depth_m
    assert max(-low[1], high[1]) <= width_m / 2 + 0.001
    assert low[2] == pytest.approx(low_m, abs=0.02)


def test_a_tub_and_a_basin_are_hollow() -> None:
    for make, top_m in ((bathroom.bathtub, 0.56), (bathroom.washbasin, 0.85)):
        parts = make(np.random.default_rng(0))
        inside = next(part for part in parts if _faces_up_below(part, top_m - 0.05))
        assert inside.material == bathroom.CERAMIC


def _faces_up_below(part: Part, height_m: float) -> bool:
    """Whether a part of ceramic has level faces that look up below a height."""
    if part.material != bathroom.CERAMIC:
        return False
    corners = part.arrays.corners_m
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    is_bottom = (area[:, 2] > 0.9 * np.linalg.norm(area, axis=1)) & (corners[..., 2].max(axis=1) < height_m)
    return bool(is_bottom.any())


def test_a_mirror_hangs_above_a_basin_only_where_it_is_asked_for() -> None:
    without = bathroom.washbasin(np.random.default_rng(0))
    mirrored = bathroom.washbasin(np.random.default_rng(0), mirror_m=(0.6, 0.75))
    assert not any(part.material.kind == "mirror" for part in without)
    assert any(part.material.kind == "mirror" for part in mirrored)
