"""Build generated places, and count those in which something is wrong.

    python benchmarks/places.py [--seeds 500] [--first 1] [--place flat] [--place street]

Each seed is built under one of the four lightings in turn and checked by `vobench.asset.place_check`, or
`vobench.asset.site_check` for places that are no floor plan: nothing overlaps or floats, a body gets through every room
or along the street, something shines, and the number of faces is moderate. Printed
are the complaints, the time to build, the number of faces, and the share of the surface that another seed changes: of
faces that the place before has not, with the same corners and colour.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np

from vobench.asset import home, paper_room, park, place_check, site_check, street, warehouse, workplace
from vobench.asset.daylight import LIGHTINGS
from vobench.asset.interior import Interior
from vobench.asset.site import Site
from vobench.geometry.triangle import areas_m2

MAKERS = {
    "flat": home.furnished_flat,
    "office": workplace.furnished_office,
    "park": park.generated_park,
    "room": paper_room.generated_paper_room,
    "street": street.generated_street,
    "warehouse": warehouse.generated_warehouse,
}
PLACE_M = 1e-3  # faces are the same if their corners are as near as this


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
        made = MAKERS[place](seed, LIGHTINGS[seed % len(LIGHTINGS)])
        made.place()
        seconds.append(time.process_time() - start_s)
        check = _checked(made)
        faces.append(check.faces)
        faces_per_m2.append(check.faces / check.area_m2)
        found = check.complaints
        failures += bool(found)
        for complaint in found:
            print(f"{place} {seed}: {complaint}", flush=True)
        surface = _surface(made)
        if before:
            same_m2 = sum(area_m2 for key, area_m2 in surface.items() if key in before)
            changed.append(1 - same_m2 / sum(surface.values()))
        before = surface
    print(f"{place}: {failures} of {len(seeds)} seeds fail")
    print(f"  {np.mean(seconds):.2f} CPU s to build (most {max(seconds):.2f})")
    print(f"  {np.mean(faces):.0f} faces (most {max(faces)}), {np.mean(faces_per_m2):.0f} per m2 of floor")
    if changed:
        print(f"  another seed changes {np.mean(changed):.1%} of the surface (least {min(changed):.1%})")


def _checked(made: Interior | Site) -> Check:
    """What is found in a place."""
    if isinstance(made, Site):
        return Check(site_check.complaints(made), site_check.face_count(made), made.area_m2)
    return Check(place_check.complaints(made), place_check.face_count(made), made.plan.area_m2)


def _surface(made: Interior | Site) -> dict[bytes, float]:
    """The area of each face, by its corners and the colour of its material."""
    place = made.place()
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
