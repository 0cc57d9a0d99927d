"""Furniture and fittings: what every maker of KINDS promises."""

import hashlib
from collections.abc import Sequence

import numpy as np
import pytest

from vobench.asset import furniture
from vobench.asset.furniture import Part
from vobench.asset.room import KINDS
from vobench.geometry.triangle import face_normals

FLOOR_KINDS = ("desk", "chair", "shelf", "plant", "carton", "crate", "sofa", "cabinet", "bench", "pillar", "monitor")
SIZED = {
    "desk": {"width_m": 1.8, "depth_m": 0.7, "height_m": 0.8},
    "shelf": {"width_m": 2.4, "depth_m": 0.5, "height_m": 1.5},
    "cabinet": {"width_m": 0.9, "depth_m": 0.5, "height_m": 0.8},
    "bench": {"width_m": 1.5, "depth_m": 0.6, "height_m": 0.9},
}


def made(kind: str, seed: int = 0) -> list[Part]:
    return KINDS[kind](np.random.default_rng(seed))


def digest(parts: Sequence[Part]) -> str:
    arrays = [a for p in parts for a in (p.mesh.vertices, p.mesh.faces, p.mesh.visual.uv, p.mesh.vertex_normals)]
    return hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_makes_the_same_bytes(kind: str) -> None:
    assert digest(made(kind)) == digest(made(kind))
    assert [p.material for p in made(kind)] == [p.material for p in made(kind)]


@pytest.mark.parametrize("kind", KINDS)
def test_no_face_is_degenerate_and_every_normal_looks_out(kind: str) -> None:
    for part in made(kind):
        c, mesh = part.mesh.triangles, part.mesh
        assert np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).min() > 1e-10
        facing = np.einsum("fck,fk->fc", mesh.vertex_normals[mesh.faces], face_normals(c))
        assert facing.mean(axis=1).min() > 0
        np.testing.assert_allclose(np.linalg.norm(mesh.vertex_normals, axis=1), 1, atol=1e-9)


@pytest.mark.parametrize("kind", FLOOR_KINDS)
def test_what_stands_touches_its_floor_and_does_not_sink_in(kind: str) -> None:
    lowest = min(part.mesh.vertices[:, 2].min() for part in made(kind))
    assert -0.001 <= lowest <= 0.005


@pytest.mark.parametrize("kind", SIZED)
def test_a_piece_fills_the_size_that_is_asked_for(kind: str) -> None:
    parts = KINDS[kind](np.random.default_rng(0), **SIZED[kind])
    points = np.concatenate([part.mesh.vertices for part in parts])
    wanted = [SIZED[kind][side] for side in ("depth_m", "width_m", "height_m")]
    np.testing.assert_allclose(np.ptp(points, axis=0), wanted, atol=0.05)


@pytest.mark.parametrize("kind", ["door", "radiator", "socket", "skirting", "framed", "noticeboard", "pipe", "curtain"])
def test_what_hangs_stays_before_its_wall(kind: str) -> None:
    assert min(part.mesh.vertices[:, 0].min() for part in made(kind)) >= 0


def test_reflectances_are_those_of_real_things() -> None:
    for kind in KINDS:
        for part in made(kind):
            assert 0 <= min(part.material.colour) <= max(part.material.colour) <= 1
            assert part.material.kind != "body" or part.material.eta in (1.0, 1.5)


def test_a_low_shelf_with_boxes_only_has_no_part_without_faces() -> None:
    shelves = [furniture.shelf(np.random.default_rng(seed), height_m=0.8) for seed in range(300)]
    assert min(len(part.mesh.faces) for parts in shelves for part in parts) > 0
