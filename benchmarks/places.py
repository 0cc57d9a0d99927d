"""Build generated flats and offices, and count those in which something is wrong.

    python benchmarks/places.py [--seeds 500] [--first 1] [--place flat] [--place office]

Each seed is built under one of the four lightings in turn and checked by `vobench.asset.place_check`: nothing overlaps
or floats, every room is reached by a body 0.5 m wide, something shines, and the number of faces is moderate. Printed
are the complaints, the time to build, the number of faces, and the share of the surface that another seed changes: of
faces that the place before has not, with the same corners and colour.
"""

import argparse
import time

import numpy as np

from vobench.asset import home, place_check, workplace
from vobench.asset.daylight import LIGHTINGS
from vobench.asset.interior import Interior
from vobench.geometry.triangle import areas_m2

MAKERS = {"flat": home.furnished_flat, "office": workplace.furnished_office}
PLACE_M = 1e-3  # faces are the same if their corners are as near as this


def main() -> None:
    """Build and check the places, and print what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--place", action="append", choices=sorted(MAKERS))
    options = parser.parse_args()
    for place in options.place or sorted(MAKERS):
        _report(place, range(options.first, options.first + options.seeds))


def _report(place: str, seeds: range) -> None:
    """Build and check one kind of place."""
    failures = 0
    seconds = []
    faces = []
    faces_per_m2 = []
    changed = []
    before: dict[bytes, float] = {}
    for seed in seeds:
        start_s = time.process_time()
        interior = MAKERS[place](seed, LIGHTINGS[seed % len(LIGHTINGS)])
        interior.place()
        seconds.append(time.process_time() - start_s)
        count = place_check.face_count(interior)
        faces.append(count)
        faces_per_m2.append(count / interior.plan.area_m2)
        found = place_check.complaints(interior)
        failures += bool(found)
        for complaint in found:
            print(f"{place} {seed}: {complaint}", flush=True)
        surface = _surface(interior)
        if before:
            same_m2 = sum(area_m2 for key, area_m2 in surface.items() if key in before)
            changed.append(1 - same_m2 / sum(surface.values()))
        before = surface
    print(f"{place}: {failures} of {len(seeds)} seeds fail")
    print(f"  {np.mean(seconds):.2f} CPU s to build (most {max(seconds):.2f})")
    print(f"  {np.mean(faces):.0f} faces (most {max(faces)}), {np.mean(faces_per_m2):.0f} per m2 of floor")
    if changed:
        print(f"  another seed changes {np.mean(changed):.1%} of the surface (least {min(changed):.1%})")


def _surface(interior: Interior) -> dict[bytes, float]:
    """The area of each face, by its corners and the colour of its material."""
    place = interior.place()
    areas: dict[bytes, float] = {}
    for thing in place.things:
        corners_m = thing.mesh.triangles
        rounded = np.rint(corners_m / PLACE_M).astype(np.int32)
        colour = np.array(place.materials[thing.material].colour).tobytes()
        for corners, area_m2 in zip(rounded, areas_m2(corners_m).tolist(), strict=True):
            areas[corners.tobytes() + colour] = area_m2
    return areas


if __name__ == "__main__":
    main()
