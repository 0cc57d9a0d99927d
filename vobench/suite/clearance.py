"""Finds the free space of places for bodies of some height, and in it the starts of paths."""

import json
from collections import OrderedDict
from dataclasses import replace

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.rig import Rig
from vobench.motion.free_start import NO_FLOOR_USE, FloorUse, Startable, from_free_start
from vobench.motion.wander import BodyHabits, Clearance
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import triangles
from vobench.suite.clearance_file import read_clearance, write_clearance
from vobench.suite.free_space import floor_map
from vobench.suite.scene_build import build
from vobench.suite.scene_file import scene_content
from vobench.suite.scene_spec import SceneFile

ABOVE_CAMERA_M = 0.1  # from the centre of a camera to the top of its mast
CACHED_PLACES = 16
_clearances: OrderedDict[str, Clearance] = OrderedDict()


def at_free_start(spec: Startable, scene: SceneFile, column_m: float, floor_use: FloorUse = NO_FLOOR_USE) -> Startable:
    """A path from a start in the free space of a place. Raises MotionError if there is none.

    `column_m` is the height above the floor that has to be free, and `floor_use` what things around the path need.
    """
    return from_free_start(spec, place_clearance(scene, column_m), floor_use)


def column_on_wheels_m(rig: Rig, habits: BodyHabits) -> float:
    """The height above the floor that has to be free: that of the body and of the cameras on its mast."""
    highest_camera_m = max(float(rig.T_body_camera(side)[2, 3]) for side in rig.sides)
    return max(habits.column_m, highest_camera_m + ABOVE_CAMERA_M)


def place_key(scene: SceneFile, column_m: float) -> str:
    """The settings on which the free space of a place depends."""
    place = json.dumps(scene_content(_bare(scene)), sort_keys=True)
    return f"{place} {column_m:.3f}"


def _bare(scene: SceneFile) -> SceneFile:
    """A scene without what only changes how it looks, so that all severities of a scenario share its free space."""
    return replace(scene, fog=None, rain=None, wind=None, floor=None, paint=None)


def place_clearance(scene: SceneFile, column_m: float) -> Clearance:
    """The free space of a place, found once and kept in the cache folder.

    Raises MotionError if the scene has no level floor.
    """
    key = place_key(scene, column_m)
    if key not in _clearances:
        kept = read_clearance(key)
        if kept is None:
            kept = clearance_of(_bare(scene), column_m)
            write_clearance(key, kept)
        _clearances[key] = kept
    while len(_clearances) > CACHED_PLACES:
        _clearances.popitem(last=False)
    return _clearances[key]


def clearance_of(scene: SceneFile, column_m: float) -> Clearance:
    """The free space of a scene for a body of some height. Movers do not count, as they are elsewhere soon.

    Raises MotionError if the scene has no level floor.
    """
    faces = triangles(build(scene, {}), t_ns=0)
    stationary = np.flatnonzero(faces.mover < 0)
    floor = floor_map(faces, RayCaster(faces, stationary), body_m=column_m)
    if floor is None:
        raise MotionError(f"'{scene.name}' has no level floor to wander on; is another axis up?")
    return floor.clearance()
