"""Finds the drives of cases that wander through the free space of their place."""

import json
from collections import OrderedDict

import numpy as np

from vobench.errors import MotionError
from vobench.motion.wander import WHEELED_BODIES, Clearance, Wander, WanderMotion
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
    place = json.dumps(scene_content(case.scene), sort_keys=True)
    column_m = _column_m(case, spec)
    key = f"{place} {json.dumps(plain(spec), sort_keys=True)} {column_m:.3f}"
    if key not in _drives:
        place_key = f"{place} {column_m:.3f}"
        if place_key not in _clearances:
            _clearances[place_key] = clearance_of(case.scene, column_m)
        _drives[key] = spec.motion(_clearances[place_key])
    while len(_drives) > CACHED_DRIVES:
        _drives.popitem(last=False)
    while len(_clearances) > CACHED_PLACES:
        _clearances.popitem(last=False)
    return _drives[key]


def _column_m(case: Case, spec: Wander) -> float:
    """The height above the floor that has to be free: that of the body and, on wheels, of the cameras on its mast."""
    if spec.body not in WHEELED_BODIES:
        return spec.habits.column_m
    rig = case.build_rig()
    highest_camera_m = max(float(rig.T_body_camera(side)[2, 3]) for side in rig.sides)
    return max(spec.habits.column_m, highest_camera_m + ABOVE_CAMERA_M)


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
