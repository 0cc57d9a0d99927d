"""Windows: holes in a wall, the reveals around them, and the panes in them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.surface import Surface

# A wall with holes reaches this far behind its neighbours, so that no daylight shows through a joint.
LAP_M = 0.005


@dataclass(frozen=True, slots=True)
class Window:
    """A hole around (u, v) metres from a wall's corner, with a pane depth_m behind the wall's face.

    `pane` and `reveal` name the materials of the glass and of the sides of the hole.
    """

    center_m: tuple[float, float]
    size_m: tuple[float, float]
    depth_m: float
    pane: str
    reveal: str
    instance: str

    @property
    def edges_m(self) -> tuple[float, float, float, float]:
        """First and last u, first and last v."""
        (u, v), (width, height) = self.center_m, self.size_m
        return u - width / 2, u + width / 2, v - height / 2, v + height / 2


def with_windows(wall: Surface, windows: Sequence[Window]) -> list[Surface]:
    """The wall as a grid of rectangles that leaves the windows out, then each window's reveals and pane.

    The grid's lines run through the whole wall: its parts share their corners, so no joint opens in a picture.
    """
    width, height = wall.size_m
    cuts_u = np.unique([-LAP_M, 0.0, width, width + LAP_M, *(u for w in windows for u in w.edges_m[:2])])
    cuts_v = np.unique([-LAP_M, 0.0, height, height + LAP_M, *(v for w in windows for v in w.edges_m[2:])])
    parts = [
        _part(wall, u0, u1, v0, v1)
        for u0, u1 in pairwise(cuts_u)
        for v0, v1 in pairwise(cuts_v)
        if not any(_inside(window, (u0 + u1) / 2, (v0 + v1) / 2) for window in windows)
    ]
    return parts + [surface for window in windows for surface in _fittings(wall, window)]


def _inside(window: Window, u_m: float, v_m: float) -> bool:
    u0, u1, v0, v1 = window.edges_m
    return u0 < u_m < u1 and v0 < v_m < v1


def _part(wall: Surface, u0: float, u1: float, v0: float, v1: float) -> Surface:
    axis_u, axis_v = _axes(wall)
    corner = wall.corner_m + u0 * axis_u + v0 * axis_v
    edge_u, edge_v = (u1 - u0) * axis_u, (v1 - v0) * axis_v
    return replace(wall, corner_m=corner, edge_u_m=edge_u, edge_v_m=edge_v, texture_corner_m=(float(u0), float(v0)))


def _axes(wall: Surface) -> tuple[Array, Array]:
    width, height = wall.size_m
    return wall.edge_u_m / width, wall.edge_v_m / height


def _fittings(wall: Surface, window: Window) -> list[Surface]:
    axis_u, axis_v = _axes(wall)
    u0, u1, v0, v1 = window.edges_m
    near = wall.corner_m + u0 * axis_u + v0 * axis_v
    across, along, deep = (u1 - u0) * axis_u, (v1 - v0) * axis_v, -window.depth_m * wall.normal
    pane = Surface(near + deep, across, along, window.pane, window.instance)
    sides = [(near, deep, along), (near + across, along, deep), (near, across, deep), (near + along, deep, across)]
    return [*(Surface(c, u, v, window.reveal, window.instance) for c, u, v in sides), pane]
