"""Every place that is made by code is the same for one seed and stands above its ground."""

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

from vobench.asset import picture
from vobench.scene.material import Picture

SCENES = Path(__file__).parents[2] / "scenes"
MADE = sorted(path.parent.name for path in SCENES.glob("*/maker.py"))
LARGE = ("park", "street", "warehouse")
# Triangles do not hang on what is painted on them, which takes most of the time.
PAINTED = ("boards", "carton", "fabric", "ground", "masonry", "pages", "poster", "terrazzo")


@pytest.mark.parametrize(
    "name",
    [*(name for name in MADE if name not in LARGE), *(pytest.param(name, marks=pytest.mark.slow) for name in LARGE)],
)
def test_a_place_is_the_same_for_one_seed_and_stands_above_its_ground(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for texture in PAINTED:
        monkeypatch.setattr(picture, texture, lambda *_, **__: Picture(np.zeros((8, 8, 3), np.uint8)))
    monkeypatch.setattr(picture, "noise", lambda rng, px, *_, **__: np.zeros((px, px), np.float32))
    maker = run_path(str(SCENES / name / "maker.py"))
    make, ground = maker["make"], maker.get("height", lambda x, y: 0.0)
    (things, materials, *_), (again, *_) = make(3), make(3)
    assert {thing.material for thing in things} <= materials.keys()
    for thing, other in zip(things, again, strict=True):
        assert thing.name == other.name
        np.testing.assert_array_equal(thing.mesh.vertices, other.mesh.vertices)
        assert np.isfinite(thing.mesh.vertices).all()
    over_ground = [thing.mesh.vertices[:, 2] - ground(*thing.mesh.vertices[:, :2].T) for thing in things]
    deepest = 1.1 if "height" in maker else 0.2  # a bush on a slope, and the pond under its water
    assert -deepest < min(float(heights.min()) for heights in over_ground) <= 0.0
