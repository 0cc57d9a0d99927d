"""Finds drives in the free space of places: of bodies that wander, and on paths from a free start."""

import json
from collections import OrderedDict

import numpy as np

from vobench.errors import MotionError
from vobench.motion.course import Planar
from vobench.motion.free_start import from_free_start, habits_of
from vobench.motion.wander import WHEELED_BODIES, BodyHabits, Clearance, Wander, WanderMotion
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import triangles
from vobench.suite.case import Case
from vobench.suite.free_space import floor_map
from vobench.suite.scene_build import build
from vobench.suite.scene_file import scene_content
from vobench.suite.scene_spec import SceneFile
from vobench.suite.yaml_file import plain

ABOVE_CAMERA_M = 0.1  # from the centre of a camera to the top of its mast
CACHED_DRIVES = 256
CACHED_PLACES = 16
_drives: OrderedDict[str, WanderMotion] = OrderedDict()
_clearances: OrderedDict[str, Clearance] = OrderedDict()


def wander_motion(case: Case, spec: Wander) -> WanderMotion:
    """The drive of a case through its place, which is built. Raises MotionError if there is no room for it."""
    column_m = spec.habits.column_m
    if spec.body in WHEELED_BODIES:
        column_m = _column_on_wheels_m(case, spec.habits)
    key = f"{_place_key(case, column_m)} {json.dumps(plain(spec), sort_keys=True)}"
    if key not in _drives:
        _drives[key] = spec.motion(_clearance(case, column_m))
    while len(_drives) > CACHED_DRIVES:
        _drives.popitem(last=False)
    return _drives[key]


def at_free_start(case: Case, spec: Planar) -> Planar:
    """The path of a case from a start in the free space of its place. Raises MotionError if there is none."""
    column_m = _column_on_wheels_m(case, habits_of(spec))
    return from_free_start(spec, _clearance(case, column_m))


def _column_on_wheels_m(case: Case, habits: BodyHabits) -> float:
    """The height above the floor that has to be free: that of the body and of the cameras on its mast."""
    rig = case.build_rig()
    highest_camera_m = max(float(rig.T_body_camera(side)[2, 3]) for side in rig.sides)
    return max(habits.column_m, highest_camera_m + ABOVE_CAMERA_M)


def _place_key(case: Case, column_m: float) -> str:
    """The settings on which the free space of a case's place depends."""
    place = json.dumps(scene_content(case.scene), sort_keys=True)
    return f"{place} {column_m:.3f}"


def _clearance(case: Case, column_m: float) -> Clearance:
    """The free space of a case's place, found once."""
    key = _place_key(case, column_m)
    if key not in _clearances:
        _clearances[key] = clearance_of(case.scene, column_m)
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
