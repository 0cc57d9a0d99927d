"""The settings of scores, and the settings that reproduce the scores of other tools."""

from dataclasses import dataclass, replace
from math import inf, pi
from typing import Annotated, Literal

from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError
from vobench.setting import Positive, require
from vobench.trajectory.align import AlignmentKind
from vobench.trajectory.associate import MAX_DIFF_NS, Method

Unit = Literal["f", "m", "s", "d", "r"]  # frames, metres, seconds, degrees and radians, with the letters of evo
Side = Literal["gt", "est"]
PairRule = Literal["spanning", "evo", "tum", "tartanair"]
Plane = Literal["xy", "xz", "yz"]
ScaleRule = Literal["alignment", "tartanair"]
Precision = Literal["float64", "devkit"]
Mean = Literal["micro", "macro"]
RelativeRule = Literal["rpg", "openvins"]
CoverageOf = Literal["auto", "frames"]

INDOOR_LENGTHS_M = (0.5, 1.0, 1.5, 2.0)
TARTANAIR_LENGTHS_M = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0)
KITTI_LENGTHS_M = (100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0)
KITTI_STEP_FRAMES = 10
SHORTEST_KITTI_PATH_M = 300.0  # the shortest path whose segments are as long as in KITTI
LARGEST_DELTA = {"d": 180.0, "r": pi}  # half a turn
# The unit, all pairs and side that these tools support.
PAIRS_OF_RULE: dict[PairRule, tuple[Unit, bool, Side]] = {"tum": ("s", True, "est"), "tartanair": ("f", True, "gt")}


@dataclass(frozen=True, slots=True)
class ScoreSettings:
    """The settings of a score. Those that affect a metric are part of its identity.

    `align_n` is the number of matched poses, from the first one, to which the alignment is fitted.
    `offset_ns` is added to the stamps of the estimate.
    `project` projects poses after the alignment to a plane of the truth's world, as in evo.
    Segment lengths and step, if None, follow from the length of the true path (`settled`).
    `full` measures all metrics instead of only the headline metrics.
    Raises SettingError for values that cannot be measured.
    """

    alignment: AlignmentKind = "se3"
    align_n: Annotated[int, Ge(1)] | None = None
    association: Method = "nearest"
    max_diff_ns: Annotated[int, Ge(0), Le(10**15)] = MAX_DIFF_NS
    offset_ns: Annotated[int, Ge(-2 * 10**18), Le(2 * 10**18)] = 0  # from a clock that starts at 0 to one from 1970
    project: Plane | None = None
    scale_rule: ScaleRule = "alignment"
    rpe_delta: Positive = 1.0
    rpe_unit: Unit = "f"
    rpe_all_pairs: bool = False
    rpe_pairs_from: Side = "gt"
    rpe_rule: PairRule = "spanning"
    segment_lengths_m: Annotated[tuple[Positive, ...], MinLen(1)] | None = None
    segment_step_frames: Annotated[int, Ge(1)] | None = None
    segment_precision: Precision = "float64"
    segment_mean: Mean = "micro"
    relative_rule: RelativeRule = "rpg"
    std_ddof: Literal[0, 1] = 0
    coverage_of: CoverageOf = "auto"
    fail_ratio: Positive = 0.1
    full: bool = False

    def __post_init__(self) -> None:
        require(self)
        pairs = (self.rpe_unit, self.rpe_all_pairs, self.rpe_pairs_from)
        pairs_of_rule = PAIRS_OF_RULE.get(self.rpe_rule, pairs)
        largest_delta = LARGEST_DELTA.get(self.rpe_unit, inf)
        counts_frames = self.rpe_unit == "f"
        has_tartanair_scale = self.scale_rule == "tartanair"
        if counts_frames and not self.rpe_delta.is_integer():
            raise self._error("rpe_delta", "a whole number of frames")
        if self.rpe_delta > largest_delta:
            raise self._error("rpe_delta", "half a turn or less")
        if pairs != pairs_of_rule:
            raise self._error("rpe_rule", f"spanning unless the pairs are those of {self.rpe_rule}")
        if self.rpe_rule == "tum" and self.project:
            raise self._error("rpe_rule", "spanning in a plane")
        if has_tartanair_scale and self.alignment != "se3":
            raise self._error("alignment", "se3 with the scale of TartanAir")

    def _error(self, name: str, expected: str) -> SettingError:
        """The error of one setting."""
        return SettingError(f"should be {expected} (got {getattr(self, name)!r})", name)


def settled(settings: ScoreSettings, path_m: float) -> ScoreSettings:
    """The settings, completed by the segment lengths and step for a true path of length `path_m`.

    They are 100 to 800 m and every tenth frame, as in KITTI, from 300 m (its shortest sequence has 394 m); 5 to 40 m,
    as in TartanAir, from 40 m; and 0.5 to 2 m for a shorter path.
    """
    lengths_m = settings.segment_lengths_m or _segment_lengths(path_m)
    usual_step = KITTI_STEP_FRAMES if lengths_m == KITTI_LENGTHS_M else 1
    step_frames = settings.segment_step_frames or usual_step
    return replace(settings, segment_lengths_m=lengths_m, segment_step_frames=step_frames)


def _segment_lengths(path_m: float) -> tuple[float, ...]:
    """The lengths in m of segments for a path."""
    if path_m >= SHORTEST_KITTI_PATH_M:
        return KITTI_LENGTHS_M
    if path_m >= TARTANAIR_LENGTHS_M[-1]:
        return TARTANAIR_LENGTHS_M
    return INDOOR_LENGTHS_M


_TARTANAIR = ScoreSettings(
    rpe_all_pairs=True,
    rpe_rule="tartanair",
    segment_lengths_m=TARTANAIR_LENGTHS_M,
    segment_step_frames=1,
    segment_mean="macro",
)
# The settings that reproduce the numbers of other tools, as far as they differ from the defaults.
# Sources: the defaults in the code of each tool; docs/metrics.md has the table.
LIKE: dict[str, ScoreSettings] = {
    "evo": ScoreSettings(alignment="none", association="evo", rpe_pairs_from="est", rpe_rule="evo"),
    "kitti": ScoreSettings(
        alignment="none",
        segment_lengths_m=KITTI_LENGTHS_M,
        segment_step_frames=KITTI_STEP_FRAMES,
        segment_precision="devkit",
    ),
    "rpg": ScoreSettings(alignment="sim3", association="greedy", max_diff_ns=20_000_000, full=True),
    "tum": ScoreSettings(
        association="greedy",
        max_diff_ns=20_000_000,
        rpe_unit="s",
        rpe_all_pairs=True,
        rpe_pairs_from="est",
        rpe_rule="tum",
    ),
    "openvins": ScoreSettings(
        alignment="yaw", association="in_order", max_diff_ns=20_000_000, relative_rule="openvins", std_ddof=1, full=True
    ),
    "tartanair": _TARTANAIR,
    "tartanair_mono": replace(_TARTANAIR, scale_rule="tartanair"),
}
