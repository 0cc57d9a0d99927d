"""The walls of a room: which regions of them are occupied."""

from dataclasses import dataclass, field

from vobench.asset.floor_plan import SIDES, Side


@dataclass(frozen=True, slots=True)
class WallRegion:
    """A rectangle on a wall: from `start_m` to `end_m` along it, and from `bottom_m` to `top_m` above the floor."""

    start_m: float
    end_m: float
    bottom_m: float
    top_m: float

    def overlaps(self, other: "WallRegion") -> bool:
        """Whether the two have an area in common."""
        is_apart = other.end_m <= self.start_m or self.end_m <= other.start_m
        is_above = other.top_m <= self.bottom_m or self.top_m <= other.bottom_m
        return not (is_apart or is_above)


def region_around(along_m: float, *, width_m: float, bottom_m: float, top_m: float) -> WallRegion:
    """The region whose middle is at `along_m`, a coordinate along the wall."""
    start_m = along_m - width_m / 2
    end_m = along_m + width_m / 2
    return WallRegion(start_m, end_m, bottom_m, top_m)


@dataclass(frozen=True, slots=True)
class WallSpace:
    """The occupied regions of the walls of a room."""

    _occupied: dict[Side, list[WallRegion]] = field(default_factory=lambda: {side: [] for side in SIDES})

    def occupy(self, side: Side, region: WallRegion) -> None:
        """Record that something is on a region of a wall, or in front of it."""
        self._occupied[side].append(region)

    def is_free(self, side: Side, region: WallRegion) -> bool:
        """Whether a region of a wall is free."""
        return not any(region.overlaps(occupied) for occupied in self._occupied[side])
