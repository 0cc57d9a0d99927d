"""Which of all rectangles can touch a part of a picture: corners against planes, so that few are drawn in vain."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.look import Look
from vobench.render.mesh import Batch
from vobench.render.mirror import Box
from vobench.scene.material import Glass

MARGIN_PX = 1  # samples lie up to half a pixel from the middle


@dataclass(frozen=True, slots=True)
class Crew:
    """Rectangles (Q) that move together, in their mover's frame: corners (4, 4 Q) and planes (Q, 4), homogeneous."""

    mover: int
    corners: Array
    planes: Array
    two_sided: NDArray[np.bool_]
    batch: NDArray[np.int64]

    def in_sight(self, look: Look, bounds: Array) -> NDArray[np.int64]:
        """Indices of batches with a rectangle that faces the eye and is not wholly beyond one of the bounds (P, 4)."""
        T_world_mover = look.pose(self.mover)
        eye = se3.inverse(T_world_mover) @ [*look.eye_m, 1.0]
        faces = self.two_sided | (self.planes @ eye > 0)
        inside = (bounds @ T_world_mover @ self.corners).reshape(len(bounds), -1, 4).max(-1).min(0) > 0
        found: NDArray[np.int64] = self.batch[faces & inside]
        return found


class Crowd:
    """All batches of a scene."""

    def __init__(self, batches: Sequence[Batch]) -> None:
        self._crews = [_crew(mover, batches) for mover in sorted({batch.mover for batch in batches})]

    def in_sight(self, look: Look, box: Box) -> set[int]:
        """Indices of all batches that can touch a box of a picture; of the others none does."""
        bounds = _bounds(look, box)
        return {index for crew in self._crews for index in crew.in_sight(look, bounds).tolist()}


def _crew(mover: int, batches: Sequence[Batch]) -> Crew:
    own = [batch for batch in batches if batch.mover == mover]
    quads = np.concatenate([batch.quads_m for batch in own])
    normals = np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    offsets = -np.einsum("ij,ij->i", normals, quads[:, 0])
    corners = quads.reshape(-1, 3).T
    counts = [len(batch.quads_m) for batch in own]
    return Crew(
        mover,
        np.vstack([corners, np.ones(corners.shape[1])]),
        np.column_stack([normals, offsets]),
        np.repeat([isinstance(batch.material, Glass) for batch in own], counts),
        np.repeat([batch.index for batch in own], counts),
    )


def _bounds(look: Look, box: Box) -> Array:
    """Planes (P, 4) of the world around all that a box shows, positive inside: four sides, near, and the mirror."""
    u0, u1, v0, v1 = box
    x, y, depth, w = look.view_projection
    left, right = (2 * u / look.camera.width_px - 1 for u in (u0 - MARGIN_PX, u1 + MARGIN_PX))
    top, bottom = (1 - 2 * v / look.camera.height_px for v in (v0 - MARGIN_PX, v1 + MARGIN_PX))
    sides = [x - left * w, right * w - x, y - bottom * w, top * w - y, depth + w]
    return np.array(sides if look.mirror is None else [*sides, [*look.mirror.normal, look.mirror.offset_m]])
