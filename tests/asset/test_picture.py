"""Pictures: tiles without seams, the same from the same seed, with detail at every scale."""

import os
import subprocess
import sys
from functools import partial

import numpy as np
import pytest

from vobench.asset import picture

TILES = {
    "boards": partial(picture.boards, "oak"),
    "floor": partial(picture.boards, "oak", 1, 512, 1.0, rows=6, joint_m=0.003),
    "masonry": partial(picture.masonry, "brick"),
    "fabric": picture.fabric,
    "terrazzo": partial(picture.terrazzo, 0, 512, 0.4),
    **{kind: partial(picture.ground, kind, 0, 512) for kind in picture.GROUNDS},
}
PRINTS = {
    "pages": picture.pages,
    "screen": picture.screen,
    "whiteboard": picture.whiteboard,
    "carton": picture.carton,
    "sign": partial(picture.sign, "2.14"),
    "spines": lambda: picture.spines().picture,
    **{style: partial(picture.poster, style) for style in picture.POSTERS},
}


@pytest.mark.parametrize("name", TILES)
def test_a_tile_repeats_without_a_seam(name: str) -> None:
    pixels = TILES[name]().pixels().astype(float)
    for axis in (0, 1):
        steps = np.abs(np.diff(pixels, axis=axis)).mean(axis=(1 - axis, 2))
        seam = np.abs(np.take(pixels, 0, axis) - np.take(pixels, -1, axis)).mean()
        assert seam <= steps.max() * 1.05


@pytest.mark.parametrize("name", [*TILES, *PRINTS])
def test_a_picture_is_bytes_in_colour_with_detail_in_every_octave(name: str) -> None:
    pixels = {**TILES, **PRINTS}[name]().pixels()
    assert pixels.dtype == np.uint8
    assert pixels.shape[2] == 3
    grey = pixels[: min(pixels.shape[:2]), : min(pixels.shape[:2])].mean(axis=-1)
    while min(grey.shape) >= 32:
        assert np.abs(np.diff(grey, axis=1)).mean() > 0.1
        rows, columns = (side // 2 * 2 for side in grey.shape)
        grey = grey[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2).mean(axis=(1, 3))


def test_another_seed_makes_another_picture() -> None:
    one, other = (picture.ground("plaster", seed, 256).pixels() for seed in (0, 1))
    assert (one != other).mean() > 0.5


def test_a_picture_is_made_once() -> None:
    assert picture.boards("oak") is picture.boards("oak")


def test_two_processes_make_the_same_bytes() -> None:
    code = (
        "import hashlib; from vobench.asset import picture as p;"
        "made = [p.boards('oak', 1, 256), p.pages(1), p.spines(1).picture, p.terrazzo(0, 256, 0.2), p.poster('hills')];"
        "print(hashlib.sha256(b''.join(m.pixels().tobytes() for m in made)).hexdigest())"
    )
    runs = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ | env)
        for env in ({"OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "1"}, {"OMP_NUM_THREADS": "2", "PYTHONHASHSEED": "2"})
    ]
    assert runs[0].stdout == runs[1].stdout


def test_spines_lie_side_by_side_as_thick_as_they_are_drawn_over_a_row_of_paper() -> None:
    spines = picture.spines()
    pixels = spines.picture.pixels()
    u = np.array([cell[:2] for cell in spines.cells])
    np.testing.assert_allclose(u[1:, 0], u[:-1, 1])
    assert u[-1, 1] == pytest.approx(1)
    widths = (u[:, 1] - u[:, 0]) * pixels.shape[1] / picture.SPINE_PX_PER_M
    np.testing.assert_allclose(widths, [thick for thick, _ in spines.sizes_m], atol=0.5 / picture.SPINE_PX_PER_M)
    assert np.abs(pixels[-1].astype(float).mean(axis=0) - picture.rgb(picture.PAPER)).max() < 12
