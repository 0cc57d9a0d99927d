"""A generator as a stranger would write it, small enough to draw in a moment, and a scene and a suite of its places."""

from pathlib import Path

GENERATOR = '''"""Cells by seed: a paved floor with walls around it, and a crate somewhere on it."""

import numpy as np

from vobench.plugin import (
    GeneratedPlace,
    Material,
    PointLight,
    Procedural,
    Sky,
    Surroundings,
    Thing,
    at,
    block,
    moved,
)

SKY_LX = {"day": 15000.0, "evening": 2000.0, "night": 20.0, "overcast": 8000.0}
WALL_M = 0.1
HEIGHT_M = 1.5


def generate(seed, lighting):
    """The cell of a seed."""
    rng = np.random.default_rng(seed)
    side_m = float(rng.uniform(3.0, 4.0))
    corner_m = float(rng.uniform(0.9, 1.1))

    paving = Procedural("terrazzo", albedo=0.5, contrast=0.5, tile_m=1.0, resolution_px=64, seed=seed)
    plaster = tuple(rng.uniform(0.3, 0.7, 3).tolist())
    materials = {"paving": Material(texture=paving), "plaster": Material(colour=plaster)}
    floor = block((side_m, side_m, WALL_M), transform=at(0, 0, -WALL_M / 2))
    things = [Thing("floor", floor, "paving")]
    for number, (x, y) in enumerate([(1, 0), (-1, 0), (0, 1), (0, -1)]):
        size_m = (WALL_M, side_m, HEIGHT_M) if x else (side_m, WALL_M, HEIGHT_M)
        wall = block(size_m, transform=at(x * side_m / 2, y * side_m / 2, HEIGHT_M / 2))
        things.append(Thing(f"wall_{number}", wall, "plaster"))
    things.append(Thing("crate", block((0.3, 0.3, 0.4), transform=at(corner_m, corner_m, 0.2)), "plaster"))

    lamp = PointLight("lamp", np.array([0.0, 0.0, 1.4]), power_lm=600.0)
    sky = Sky("sky", SKY_LX[lighting], panorama=Surroundings(kind="city", seed=seed))
    return GeneratedPlace(things, materials, [lamp, sky])
'''
SCENE = """name: cell
summary: A cell of a generator
generator: generator.py
"""
SUITE = """name: cells
seed: 1
scenes: [{name: cell, seeds: 2}]
rigs: {down: {lens: paper_blender, picture_scale: 0.1, pitch_deg: 90}}
trajectories: {tour: {kind: wander, length_m: 0.5, rate_hz: 4, seeds: 2}}
cameras: {clean: {}, noisy: {gain_db: 12}}
spread: {units: 4, each: 2}
estimators: [wheel_odometry, stand_still]
"""


def write_cell(folder: Path, generator: str = GENERATOR, *, name: str = "cell") -> Path:
    """Write the scene `cell`, or another name, and its generator into a folder. Returns the path of the scene."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "generator.py").write_text(generator, encoding="utf-8")
    scene = folder / "scene.yaml"
    scene.write_text(SCENE.replace("cell", name), encoding="utf-8")
    return scene
