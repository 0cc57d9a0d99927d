"""Everything that changes a score besides the two trajectories, and how other tools set it."""

from dataclasses import dataclass, replace
from math import inf, pi
from typing import Annotated, Literal

from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError
from vobench.setting import Positive, require
from vobench.trajectory.align import Kind
from vobench.trajectory.associate import MAX_DIFF_NS, Method

Unit = Literal["f", "m", "s", "d", "r"]  # evo's letters: frames, metres, degrees, radians; and s for seconds
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
LARGEST = {"d": 180.0, "r": pi}  # half a turn
# Unit, all pairs and side: the only pairs that these tools have.
PAIRS_OF_RULE: dict[PairRule, tuple[Unit, bool, Side]] = {"tum": ("s", True, "est"), "tartanair": ("f", True, "gt")}


@dataclass(frozen=True, slots=True)
class ScoreSettings:
    """What is asked of a score; the part that concerns a metric is written into its identity.

    `align_n` fits only the first so many matched poses; `offset_ns` is added to the estimate's stamps;
    `project` drops, after the alignment, what is not in a plane of the truth's world, as evo does;
    segment lengths and step left None follow the length of the true path (`settled`); `full`
    measures everything, not only the headline metrics. Raises SettingError for what measures nothing.
    """

    alignment: Kind = "se3"
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
        own_pairs = PAIRS_OF_RULE.get(self.rpe_rule)
        is_tartanair = self.scale_rule == "tartanair"
        demands = [
            ("rpe_delta", self.rpe_unit != "f" or self.rpe_delta.is_integer(), "a whole number of frames"),
            ("rpe_delta", self.rpe_delta <= LARGEST.get(self.rpe_unit, inf), "half a turn or less"),
            ("rpe_rule", own_pairs in (None, pairs), f"spanning but for {self.rpe_rule}'s own pairs"),
            ("rpe_rule", self.rpe_rule != "tum" or not self.project, "spanning in a plane"),
            ("alignment", not is_tartanair or self.alignment == "se3", "se3 where TartanAir's own scale is asked for"),
        ]
        for name, is_right, right in demands:
            if not is_right:
                raise SettingError(f"should be {right} (got {getattr(self, name)!r})", name)


def settled(settings: ScoreSettings, path_m: float) -> ScoreSettings:
    """The settings with the segments that suit a true path of path_m, where they leave them open.

    KITTI's 100..800 m every tenth frame from 300 m on (its shortest sequence has 394 m), TartanAir's
    5..40 m from 40 m on, 0.5..2 m for what is shorter.
    """
    fitting = INDOOR_LENGTHS_M if path_m < TARTANAIR_LENGTHS_M[-1] else TARTANAIR_LENGTHS_M
    fitting = KITTI_LENGTHS_M if path_m >= KITTI_LENGTHS_M[2] else fitting
    lengths = settings.segment_lengths_m or fitting
    usual_step = KITTI_STEP_FRAMES if lengths == KITTI_LENGTHS_M else 1
    step = settings.segment_step_frames or usual_step
    return replace(settings, segment_lengths_m=lengths, segment_step_frames=step)


_TARTANAIR = ScoreSettings(
    rpe_all_pairs=True,
    rpe_rule="tartanair",
    segment_lengths_m=TARTANAIR_LENGTHS_M,
    segment_step_frames=1,
    segment_mean="macro",
)
# The settings with which other tools score, so that their numbers come out here: what differs from ours.
# Sources: each tool's own defaults, as its code has them; docs/metrics.md has the table.
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
