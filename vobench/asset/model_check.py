"""Notes on models that were probably read with the wrong axis up or in the wrong unit."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals

SMALLEST_M = 0.05  # a smaller model is probably in another unit
LARGEST_M = 500.0  # a larger model is probably in another unit
TYPICAL_M = 5.0  # the extent of most models
PLACE_M = 3.0  # a larger model may be a place, such as a room, instead of an object
# A place whose sideways-facing area is more than this multiple of its upward-facing area probably lies on its side.
SIDEWAYS_RATIO = 2.0
# A place that is much flatter along y than along x and z is a slab. A slab that stands upright probably lies on its
# side already if its sideways-facing area is more than this multiple of its upward-facing area.
SLAB_SIDEWAYS_RATIO = 0.5
SLAB_DEPTH_RATIO = 0.5  # the largest ratio of a slab's depth to its width and to its height


def axis_notes(corners_m: Array, *, file_name: str, up_axis: str) -> list[str]:
    """A note if a model is probably a place that lies on its side.

    `corners_m` (F, 3, 3) are the corners of its faces, read with `up_axis` of the file up.
    A place extends over more than PLACE_M. There are two signs that it lies on its side:

    - The area that faces along y is more than SIDEWAYS_RATIO times the area that faces along z.
    - The place is higher than PLACE_M, its extent along y is less than SLAB_DEPTH_RATIO of those along x and z, and the
      area that faces along y is more than SLAB_SIDEWAYS_RATIO times the area that faces along z. Rooms are usually
      shortest along z.
    """
    width_m, depth_m, height_m = np.ptp(corners_m, axis=(0, 1))
    projected_m2 = areas_m2(corners_m) @ np.abs(face_normals(corners_m))  # (3,), along x, y and z
    _, sideways_m2, up_m2 = projected_m2

    is_place = max(width_m, depth_m, height_m) > PLACE_M
    faces_sideways = sideways_m2 > SIDEWAYS_RATIO * up_m2
    is_slab = depth_m < SLAB_DEPTH_RATIO * min(width_m, height_m)
    has_large_sides = sideways_m2 > SLAB_SIDEWAYS_RATIO * up_m2
    is_tall_slab = is_slab and height_m > PLACE_M and has_large_sides
    if not (is_place and (faces_sideways or is_tall_slab)):
        return []
    other_axis = "z" if up_axis == "y" else "y"
    return [
        f"probably lies on its side. It is read with {up_axis} up; if {other_axis} is up, say so in a scene's YAML: "
        f"meshes: [{{file: {file_name}, up: {other_axis}}}]"
    ]


def unit_notes(corners_m: Array) -> list[str]:
    """A note if the unit of a model with face corners (F, 3, 3) is probably not the metre."""
    span_m = float(np.ptp(corners_m, axis=(0, 1)).max())
    if SMALLEST_M <= span_m <= LARGEST_M:
        return []

    question_by_scale = {
        0.001: "in millimetres?",
        0.01: "in centimetres?",
        100.0: "shrunk twice?",
        1000.0: "shrunk twice?",
    }
    positive_span_m = max(span_m, 1e-9)
    likeliest_scale = min(question_by_scale, key=lambda scale: abs(np.log(positive_span_m * scale / TYPICAL_M)))
    return [f"spans {span_m:,.4g} m: {question_by_scale[likeliest_scale]} scale: {likeliest_scale:g}"]
