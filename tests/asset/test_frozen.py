"""What the pieces of furniture and their pictures look like is frozen: scores of scenes depend on it.

`python tests/asset/test_frozen.py` writes the figures anew where a change is meant; CHANGELOG.md then says so.
"""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from vobench.asset import household, outdoors, picture
from vobench.asset.room import FINISHES, KINDS
from vobench.geometry.triangle import areas_m2

FROZEN = Path(__file__).with_name("frozen.json")
PICTURES = {
    **{f"boards {tones}": partial(picture.boards, tones, 1, 256) for tones in ("oak", "beech")},
    "boards jointed": partial(picture.boards, "oak", 1, 256, 2.0, rows=4, joint_m=0.01),
    **{f"masonry {tones}": partial(picture.masonry, tones, 1, 256) for tones in ("brick", "tile")},
    **{f"ground {kind}": partial(picture.ground, kind, 1, 256) for kind in picture.GROUNDS},
    "fabric": partial(picture.fabric, 1, 256),
    "terrazzo": partial(picture.terrazzo, 1, 256, 0.4),
    "pages": partial(picture.pages, 1),
    "screen": partial(picture.screen, 1),
    **{f"poster {style}": partial(picture.poster, style, 1) for style in picture.POSTERS},
    "whiteboard": partial(picture.whiteboard, 1),
    "carton": partial(picture.carton, 1),
    "sign": partial(picture.sign, "A-1"),
    "foliage": partial(outdoors.foliage, 1, 256),
    "weave": partial(household._weave, 1, 256),
    "spines": lambda: picture.spines(1, 20).picture,
}
# Vertices, coordinates and normals are float32. Processors round sines differently in the last bit of float64, so some
# of these differ in their last bit, which moves figures by up to 2e-7.
FLOAT32_ATOL = 1e-6
# Releases of Pillow draw letters a little differently.
WITH_TEXT = ("pages", "screen", "poster talk", "whiteboard", "carton", "sign", "spines")


def figures_of_kind(kind: str) -> list[float]:
    """Random projections of counts, areas, vertices, texture coordinates, normals and materials, always the same."""
    weights = np.random.default_rng(1)
    figures = []
    for part in KINDS[kind](np.random.default_rng(7)):
        mesh = part.arrays
        index = weights.standard_normal(len(mesh.vertices_m)) / np.sqrt(max(len(mesh.vertices_m), 1))
        material = part.material
        figures += [len(mesh.faces), areas_m2(mesh.corners_m).sum(), *index @ mesh.vertices_m, *index @ mesh.uv]
        figures += [*index @ mesh.normals, *material.colour, material.roughness, material.metal, material.eta]
    projection = np.random.default_rng(2).standard_normal((12, len(figures)))
    return [float(value) for value in projection @ np.array(figures)]


def figures_of_picture(name: str) -> list[float]:
    """Size and projections on fixed random directions of a picture's pixels."""
    pixels = PICTURES[name]().pixels()
    values = pixels.reshape(-1, pixels.shape[-1]).astype(float) / 255
    index = np.random.default_rng(3).standard_normal((8, len(values))) / np.sqrt(len(values))
    return [float(value) for value in (len(values), *values.mean(0), *(index @ values).ravel())]


@pytest.mark.parametrize("kind", KINDS)
def test_a_piece_looks_as_it_did(kind: str) -> None:
    frozen = json.loads(FROZEN.read_text())["kinds"][kind]
    np.testing.assert_allclose(figures_of_kind(kind), frozen, rtol=1e-9, atol=FLOAT32_ATOL)


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_looks_as_it_did(name: str) -> None:
    frozen = json.loads(FROZEN.read_text())["pictures"][name]
    # Processors round a few pixels' last bit otherwise.
    tolerance = 0.02 if name in WITH_TEXT else 2e-4
    np.testing.assert_allclose(figures_of_picture(name), frozen, rtol=1e-4, atol=tolerance)


def test_every_finish_is_a_material() -> None:
    assert all(make().kind in ("body", "mirror", "pane") for make in FINISHES.values())


def write() -> None:
    """Write the figures as they are now."""
    kinds = {kind: figures_of_kind(kind) for kind in KINDS}
    pictures = {name: figures_of_picture(name) for name in PICTURES}
    FROZEN.write_text(json.dumps({"kinds": kinds, "pictures": pictures}, indent=1) + "\n")


if __name__ == "__main__":
    write()
