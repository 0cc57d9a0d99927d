"""Things on a surface lie side by side within its width."""

from itertools import pairwise

import pytest

from tests.asset.rooms import room_layout
from vobench.asset.placed_piece import vertices_of
from vobench.asset.tabletop import add_tabletop_items, tabletop_items


def test_things_on_a_surface_lie_side_by_side_within_its_width() -> None:
    for seed in range(20):
        layout = room_layout(seed=seed)
        spot = layout.spot("south", 0.0)
        names = ("mug", "pens", "plant", "bottle")
        add_tabletop_items(layout, "a", spot, names, x_m=0.3, width_m=1.0, z_m=0.7)
        spans = []
        for piece in layout.placed:
            vertices_m = vertices_of(piece.parts)
            assert vertices_m[:, 2].min() == pytest.approx(0.7, abs=0.002)
            spans.append((vertices_m[:, 0].min(), vertices_m[:, 0].max()))
        spans.sort()
        assert len(spans) >= 3
        assert spans[0][0] > -0.53
        assert spans[-1][1] < 0.53
        for (_, end_m), (start_m, _) in pairwise(spans):
            assert start_m > end_m - 0.02


def test_things_without_space_are_left_out() -> None:
    layout = room_layout()
    spot = layout.spot("south", 0.0)
    add_tabletop_items(layout, "a", spot, ("mug", "plant", "papers"), x_m=0.3, width_m=0.2, z_m=0.7)
    assert [piece.name for piece in layout.placed] == ["study_1.mug_1"]


def test_every_thing_is_no_wider_than_its_space() -> None:
    layout = room_layout()
    for item in tabletop_items(layout).values():
        layout.add(item.kind, item.make, (0.0, 0.0), **item.options)
        y_m = vertices_of(layout.placed[-1].parts)[:, 1]
        if item.kind not in ("books", "papers"):
            assert abs(y_m).max() < item.half_width_m + 0.03, item.kind
