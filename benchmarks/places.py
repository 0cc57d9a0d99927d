"""Build generated places, and count those in which something is wrong.

    python benchmarks/places.py [--seeds 500] [--first 1] [--place flat] [--place street]
    python benchmarks/places.py --again 10 [--first 1] [--place flat] [--place street]

Each seed is built under one of the four lightings in turn. Three modules check it:

- `vobench.asset.place_check`, or `vobench.asset.site_check` for places that are no floor plan: nothing overlaps or
  floats, a body gets through every room or along the street, something shines, and the number of faces is moderate.
- `vobench.asset.surface_check`: faces have an area and the right normals, and materials are plausible.
- `vobench.suite.maker_message`: arrays fit together, numbers are finite, and no material is missing.

The script prints the complaints, the time to build, the number of faces, and the share of the surface that another seed
changes: that of faces whose corners and colour do not occur in the place before.

`--again N` builds N seeds twice, here and in a fresh process, and compares all bytes, those of textures included.
"""

import argparse
import hashlib
import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.asset import (
    home,
    paper_room,
    park,
    place_check,
    site_check,
    street,
    surface_check,
    warehouse,
    workplace,
)
from vobench.asset.daylight import LIGHTINGS
from vobench.asset.interior import Interior
from vobench.asset.site import Site
from vobench.errors import SuiteError
from vobench.geometry.triangle import areas_m2
from vobench.scene.generated_place import GeneratedPlace
from vobench.suite.maker_message import checked_place, encode

MAKERS = {
    "flat": home.furnished_flat,
    "office": workplace.furnished_office,
    "park": park.generated_park,
    "room": paper_room.generated_paper_room,
    "street": street.generated_street,
    "warehouse": warehouse.generated_warehouse,
}
PLACE_M = 1e-3  # faces are the same if their corners are as near as this
PROGRESS_SEEDS = 50  # after so many seeds, the number of failures so far is printed
# Odd factors that make one number of the nine corner coordinates and three colour values of a face.
KEY_FACTORS = np.random.default_rng(0).integers(1, 1 << 62, 12, dtype=np.uint64) * np.uint64(2) + np.uint64(1)


@dataclass(frozen=True, slots=True)
class Surface:
    """The faces of a place: `keys` (F,) of their corners and colours, and areas (F,)."""

    keys: NDArray[np.uint64]
    areas_m2: NDArray[np.float64]

    def share_not_in(self, other: "Surface") -> float:
        """The share of the area whose faces another place does not have."""
        is_new = ~np.isin(self.keys, other.keys)
        return float(self.areas_m2[is_new].sum() / self.areas_m2.sum())


@dataclass(frozen=True, slots=True)
class Check:
    """What is wrong with a place, its number of faces, and the area of its floor or its roads."""

    complaints: list[str]
    faces: int
    area_m2: float


def main() -> None:
    """Build and check the places, and print what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--place", action="append", choices=sorted(MAKERS))
    parser.add_argument("--again", type=int)
    options = parser.parse_args()
    for place in options.place or sorted(MAKERS):
        if options.again:
            _compare_bytes(place, range(options.first, options.first + options.again))
        else:
            _report(place, range(options.first, options.first + options.seeds))


def _made(place: str, seed: int) -> Interior | Site:
    """The place of a seed, under one of the lightings."""
    return MAKERS[place](seed, LIGHTINGS[seed % len(LIGHTINGS)])


def _report(place: str, seeds: range) -> None:
    """Build and check one kind of place."""
    failures = 0
    seconds = []
    faces = []
    faces_per_m2 = []
    changed = []
    surface_before: Surface | None = None
    for count, seed in enumerate(seeds, start=1):
        start_s = time.process_time()
        made = _made(place, seed)
        generated = made.place()
        seconds.append(time.process_time() - start_s)
        check = _checked(made)
        faces.append(check.faces)
        faces_per_m2.append(check.faces / check.area_m2)
        complaints = [*check.complaints, *surface_check.complaints(generated), *_unreadable(generated)]
        failures += bool(complaints)
        for complaint in complaints:
            print(f"{place} {seed}: {complaint}", flush=True)
        surface = _surface(generated)
        if surface_before:
            changed.append(surface.share_not_in(surface_before))
        surface_before = surface
        if count % PROGRESS_SEEDS == 0:
            print(f"{place}: {failures} of {count} seeds fail so far", flush=True)
    print(f"{place}: {failures} of {len(seeds)} seeds fail")
    print(f"  {np.mean(seconds):.2f} CPU s to build (most {max(seconds):.2f})")
    print(f"  {np.mean(faces):.0f} faces (most {max(faces)}), {np.mean(faces_per_m2):.0f} per m2 of floor")
    if changed:
        print(f"  another seed changes {np.mean(changed):.1%} of the surface (least {min(changed):.1%})", flush=True)


def _compare_bytes(place: str, seeds: range) -> None:
    """Build places of one kind twice, and count those whose bytes differ."""
    spawn = multiprocessing.get_context("spawn")  # of processes whose hashes of strings have another seed
    differing = []
    for seed in seeds:
        with ProcessPoolExecutor(1, mp_context=spawn) as fresh_process:
            elsewhere = fresh_process.submit(_digest, place, seed).result()
        if _digest(place, seed) != elsewhere:
            differing.append(seed)
    print(f"{place}: {len(differing)} of {len(seeds)} seeds differ when built again {differing or ''}", flush=True)


def _digest(place: str, seed: int) -> str:
    """The SHA-256 of everything in a place."""
    return hashlib.sha256(encode(_made(place, seed).place())).hexdigest()


def _unreadable(place: GeneratedPlace) -> list[str]:
    """Why vobench refuses a place; empty if it does not."""
    try:
        checked_place(place)
    except SuiteError as error:
        return [str(error)]
    return []


def _checked(made: Interior | Site) -> Check:
    """What is found in a place."""
    if isinstance(made, Site):
        return Check(site_check.complaints(made), site_check.face_count(made), made.area_m2)
    return Check(place_check.complaints(made), place_check.face_count(made), made.plan.area_m2)


def _surface(place: GeneratedPlace) -> Surface:
    """The faces of a place."""
    keys = []
    areas = []
    for thing in place.things:
        corners_m = thing.mesh.triangles
        rounded_corners = np.rint(corners_m / PLACE_M).reshape(-1, 9)
        colour = np.array(place.materials[thing.material].colour)
        colours = np.tile(np.rint(colour / PLACE_M), (len(corners_m), 1))
        numbers = np.hstack([rounded_corners, colours]).astype(np.int64)
        keys.append((numbers.view(np.uint64) * KEY_FACTORS).sum(axis=1))
        areas.append(areas_m2(corners_m))
    return Surface(np.concatenate(keys), np.concatenate(areas))


if __name__ == "__main__":
    main()
