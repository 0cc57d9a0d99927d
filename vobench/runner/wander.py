"""Finds the drives of bodies that wander through the free space of places."""

import json
from collections import OrderedDict

from vobench.motion.wander import WHEELED_BODIES, Wander, WanderMotion
from vobench.suite.case import Case
from vobench.suite.clearance import column_on_wheels_m, place_clearance, place_key
from vobench.suite.yaml_file import plain

CACHED_DRIVES = 256
_drives: OrderedDict[str, WanderMotion] = OrderedDict()


def wander_motion(case: Case, spec: Wander) -> WanderMotion:
    """The drive of a case through its place, which is built. Raises MotionError if there is no room for it."""
    column_m = spec.habits.column_m
    if spec.body in WHEELED_BODIES:
        column_m = column_on_wheels_m(case.build_rig(), spec.habits)
    key = f"{place_key(case.scene, column_m)} {json.dumps(plain(spec), sort_keys=True)}"
    if key not in _drives:
        _drives[key] = spec.motion(place_clearance(case.scene, column_m))
    while len(_drives) > CACHED_DRIVES:
        _drives.popitem(last=False)
    return _drives[key]
