"""A small floor plan: a hall with the entrance, and a study with a door and a window."""

from vobench.asset.floor_plan import FloorPlan, Passage, Rect, Room, Window

HALL = Room("hall_1", "hall", Rect(0, 0, 4, 2))
STUDY = Room("study_1", "study", Rect(0, 2.12, 4, 5))
DOOR = Passage(("study_1", "hall_1"), Rect(0.2, 2, 1.2, 2.12), "door", opens_into="study_1", leaf_end=0)
WINDOW = Window("study_1", Rect(1.5, 5, 2.5, 5.2), 0.9, 2.1)
ENTRANCE = Window("hall_1", Rect(-0.12, 0.5, 0, 1.4), 0.0, 2.05)
PLAN = FloorPlan((HALL, STUDY), (DOOR,), (WINDOW,), ENTRANCE, 2.6)
