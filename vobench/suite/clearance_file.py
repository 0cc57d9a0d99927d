"""Keeps the free space of places in the cache folder, since building a place takes seconds."""

import hashlib
import json
import os
import tempfile
import zipfile
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np

from vobench.motion.wander import Clearance

FOLDER = "free_space"  # below vobench's cache folder
PACKAGE = Path(__file__).resolve().parents[1]
LIBRARIES = ("numpy", "scipy", "trimesh", "embreex")  # whose versions can change the free space


def read_clearance(place: str) -> Clearance | None:
    """The free space that was kept for a place, None if there is none. `place` is all that it depends on but code."""
    try:
        with _path(place).open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            x_m, y_m, floor_m, cell_m = arrays["grid"].tolist()
            return Clearance(
                x_m,
                y_m,
                floor_m,
                cell_m,
                distance_m=arrays["distance_m"],
                ground_m=arrays.get("ground_m"),
            )
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):  # it is missing or damaged
        return None


def write_clearance(place: str, clearance: Clearance) -> None:
    """Keep the free space of a place. In a cache folder that cannot be written, nothing is kept."""
    arrays = {
        "grid": np.array([clearance.x_m, clearance.y_m, clearance.floor_m, clearance.cell_m]),
        "distance_m": clearance.distance_m,
    }
    if clearance.ground_m is not None:
        arrays["ground_m"] = clearance.ground_m
    path = _path(place)
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        # Another process may read the file at any time, so it gets its name when it is complete.
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)
        os.replace(file.name, path)


def _path(place: str) -> Path:
    """The file of a place."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    root = Path(os.environ.get("VOBENCH_CACHE") or home / "vobench")
    key = json.dumps([place, _code()])
    return root / FOLDER / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"


@cache
def _code() -> str:
    """A hash of all code of vobench, and of the versions of the libraries that it uses for this."""
    state = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        state.update(f"{path.relative_to(PACKAGE)}\0".encode())
        state.update(hashlib.sha256(path.read_bytes()).digest())
    state.update(json.dumps([version(library) for library in LIBRARIES]).encode())
    return state.hexdigest()
