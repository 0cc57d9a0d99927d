"""Props of a scenario: boards and movers around its path, which move along with the path to other places."""

from dataclasses import field, replace
from itertools import pairwise

import numpy as np

from vobench.geometry.se3 import Array
from vobench.motion.free_start import FloorUse, Relocation, joined_floor_use
from vobench.setting import Name, settings
from vobench.suite.scene_spec import BoardSpec, MaterialSpec, MoverSpec, SceneFile

POINT_M = 0.1  # the distance between points at which the floor is checked
BOARD_RADIUS_M = 0.05
MOVER_RADIUS_M = 0.35  # of a person whose arms swing


@settings()
class Props:
    """Things that a scenario puts around its path, and their materials."""

    materials: dict[Name, MaterialSpec] = field(default_factory=dict)
    boards: tuple[BoardSpec, ...] = ()
    movers: tuple[MoverSpec, ...] = ()

    @property
    def floor_use(self) -> FloorUse:
        """What they need of the floor."""
        of_boards = [_floor_use(_board_points_m(board), BOARD_RADIUS_M) for board in self.boards]
        of_movers = [_floor_use(_path_points_m(mover), MOVER_RADIUS_M) for mover in self.movers]
        return joined_floor_use([*of_boards, *of_movers])

    def relocated(self, move: Relocation) -> "Props":
        """The props after a motion on the floor."""
        boards = []
        for board in self.boards:
            center_m = move.position_m(board.center_m)
            boards.append(replace(board, center_m=center_m, yaw_deg=board.yaw_deg + move.turn_deg))
        movers = []
        for mover in self.movers:
            path = tuple(
                replace(key, position_m=move.position_m(key.position_m), yaw_deg=key.yaw_deg + move.turn_deg)
                for key in mover.path
            )
            movers.append(replace(mover, path=path))
        return replace(self, boards=tuple(boards), movers=tuple(movers))

    def in_scene(self, scene: SceneFile) -> SceneFile:
        """A place of a generator with the props in it."""
        return replace(scene, materials=self.materials, boards=self.boards, movers=self.movers)


def _floor_use(points_m: Array, radius_m: float) -> FloorUse:
    """Points (N, 2) with the same radius."""
    return FloorUse(points_m, np.full(len(points_m), radius_m))


def _board_points_m(board: BoardSpec) -> Array:
    """Points (N, 2) along the foot of a board."""
    yaw_rad = np.deg2rad(board.yaw_deg)
    along = np.array([-np.sin(yaw_rad), np.cos(yaw_rad)])
    half_m = board.size_m[0] / 2
    offsets_m = np.linspace(-half_m, half_m, _count(board.size_m[0]))
    points_m: Array = np.array(board.center_m[:2]) + offsets_m[:, None] * along
    return points_m


def _path_points_m(mover: MoverSpec) -> Array:
    """Points (N, 2) along the path of a mover."""
    corners_m = np.array([key.position_m[:2] for key in mover.path])
    pieces = []
    for start_m, end_m in pairwise(corners_m):
        shares = np.linspace(0, 1, _count(float(np.linalg.norm(end_m - start_m))))
        pieces.append(start_m + shares[:, None] * (end_m - start_m))
    return np.concatenate(pieces)


def _count(length_m: float) -> int:
    """How many points a length is checked at."""
    return max(int(np.ceil(length_m / POINT_M)) + 1, 2)
