"""Shells of floor plans are closed."""

import numpy as np
import pytest

from tests.asset.floor_plans import PLAN
from vobench.asset import home, workplace
from vobench.asset.furniture import WHITE
from vobench.asset.interior import Interior
from vobench.asset.interior_shell import RoomFinish, shell


def finishes() -> dict[str, RoomFinish]:
    plain = RoomFinish(WHITE, WHITE, dict.fromkeys(("east", "north", "west", "south"), WHITE))
    return {room.name: plain for room in PLAN.rooms}


def _escapes(interior: Interior, count: int = 20000) -> int:
    """How many rays from inside the rooms hit nothing."""
    embree = pytest.importorskip("embreex.mesh_construction")
    scenes = pytest.importorskip("embreex.rtcore_scene")
    parts = [part for _, parts in interior.shell for part in parts]
    corners = np.concatenate([part.arrays.corners_m for part in parts])
    scene = scenes.EmbreeScene()
    embree.TriangleMesh(scene, corners.astype(np.float32))
    rng = np.random.default_rng(0)
    rects = [room.rect.grown(-0.05) for room in interior.plan.rooms]
    chosen = rng.integers(len(rects), size=count)
    low_m = np.array([[rect.x0, rect.y0, 0.05] for rect in rects])[chosen]
    high_m = np.array([[rect.x1, rect.y1, interior.plan.height_m - 0.05] for rect in rects])[chosen]
    origins_m = rng.uniform(low_m, high_m)
    directions = rng.standard_normal((count, 3))
    hits = scene.run(origins_m.astype(np.float32), directions.astype(np.float32))
    return int((hits < 0).sum())


def test_no_ray_leaves_the_shell_of_a_plan_with_doors_and_windows() -> None:
    instances = tuple(shell(PLAN, finishes(), thresholds=WHITE))
    assert _escapes(Interior(PLAN, instances, (), ())) == 0


@pytest.mark.parametrize("make", [home.furnished_flat, workplace.furnished_office])
def test_no_ray_leaves_the_shell_of_a_generated_place(make) -> None:  # type: ignore[no-untyped-def]
    for seed in (1, 2, 3):
        assert _escapes(make(seed, "day")) == 0


def test_rays_leave_a_shell_whose_ceiling_is_missing() -> None:
    instances = tuple(each for each in shell(PLAN, finishes(), thresholds=WHITE) if "ceiling" not in each[0])
    assert _escapes(Interior(PLAN, instances, (), ())) > 1000
