"""Everything that changes a score besides the two trajectories, and how other tools set it."""

from dataclasses import dataclass, replace
from math import inf, isfinite, pi
from typing import Any, Literal, get_args, get_origin, get_type_hints

from vobench.errors import AlignmentError
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


@dataclass(frozen=True, slots=True)
class ScoreSettings:
    """What is asked of a score; the part that concerns a metric is written into its identity.

    `align_n` fits only the first so many matched poses; `offset_ns` is added to the estimate's stamps;
    `project` drops, after the alignment, what is not in a plane of the truth's world, as evo does;
    segment lengths and step left None follow the length of the true path (`settled`); `full`
    measures everything, not only the headline metrics. Raises AlignmentError for what measures nothing.
    """

    alignment: Kind = "se3"
    align_n: int | None = None
    association: Method = "nearest"
    max_diff_ns: int = MAX_DIFF_NS
    offset_ns: int = 0
    project: Plane | None = None
    scale_rule: ScaleRule = "alignment"
    rpe_delta: float = 1.0
    rpe_unit: Unit = "f"
    rpe_all_pairs: bool = False
    rpe_pairs_from: Side = "gt"
    rpe_rule: PairRule = "spanning"
    segment_lengths_m: tuple[float, ...] | None = None
    segment_step_frames: int | None = None
    segment_precision: Precision = "float64"
    segment_mean: Mean = "micro"
    relative_rule: RelativeRule = "rpg"
    std_ddof: int = 0
    coverage_of: CoverageOf = "auto"
    fail_ratio: float = 0.1
    full: bool = False

    def __post_init__(self) -> None:
        for name, value, is_right, right in self._demands():
            if not is_right:
                raise AlignmentError(f"{name} should be {right}, but is {value!r}")

    def _demands(self) -> list[tuple[str, Any, bool, str]]:
        """(name, value, whether it is right, what is right) of each setting that can be wrong."""
        choices = [(name, getattr(self, name), known) for name, known in CHOICES.items()]
        whole = self.rpe_delta == round(self.rpe_delta) if isfinite(self.rpe_delta) else False
        pairs, own_pairs = (self.rpe_unit, self.rpe_all_pairs, self.rpe_pairs_from), PAIRS_OF_RULE.get(self.rpe_rule)
        lengths, step = self.segment_lengths_m, self.segment_step_frames
        return [
            *((name, value, value in known, f"one of {', '.join(map(str, known))}") for name, value, known in choices),
            ("align_n", self.align_n, self.align_n is None or self.align_n >= 1, "1 or more"),
            ("max_diff_ns", self.max_diff_ns, self.max_diff_ns >= 0, "0 or more"),
            ("rpe_delta", self.rpe_delta, isfinite(self.rpe_delta) and self.rpe_delta > 0, "more than 0 and finite"),
            ("rpe_delta", self.rpe_delta, self.rpe_unit != "f" or whole, "a whole number of frames"),
            ("rpe_delta", self.rpe_delta, self.rpe_delta <= _LARGEST.get(self.rpe_unit, inf), "half a turn or less"),
            ("rpe_rule", self.rpe_rule, own_pairs in (None, pairs), f"spanning but for {self.rpe_rule}'s own pairs"),
            ("rpe_rule", self.rpe_rule, self.rpe_rule != "tum" or not self.project, "spanning in a plane"),
            (
                "alignment",
                self.alignment,
                self.scale_rule == "alignment" or self.alignment == "se3",
                "se3 where TartanAir's own scale is asked for",
            ),
            ("segment_lengths_m", lengths, lengths is None or _positive(lengths), "positive"),
            ("segment_step_frames", step, step is None or step >= 1, "1 or more"),
            ("std_ddof", self.std_ddof, self.std_ddof in (0, 1), "0 or 1"),
            ("fail_ratio", self.fail_ratio, isfinite(self.fail_ratio) and self.fail_ratio > 0, "more than 0"),
        ]


def _names(hint: Any) -> tuple[Any, ...]:
    """What an annotation of a literal, or of a literal or None, allows; nothing for any other."""
    if get_origin(hint) is Literal:
        return get_args(hint)
    own = [name for part in get_args(hint) for name in _names(part)]
    return (None, *own) if own else ()


# The names that a setting may have, where it is one of a few.
CHOICES = {name: names for name, hint in get_type_hints(ScoreSettings).items() if (names := _names(hint))}
# Unit, all pairs and side: the only pairs that these tools have.
PAIRS_OF_RULE: dict[PairRule, tuple[Unit, bool, Side]] = {"tum": ("s", True, "est"), "tartanair": ("f", True, "gt")}
_LARGEST = {"d": 180.0, "r": pi}


def _positive(lengths_m: tuple[float, ...]) -> bool:
    return bool(lengths_m) and all(isfinite(length) and length > 0 for length in lengths_m)


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
    alignment="se3",
    rpe_all_pairs=True,
    rpe_rule="tartanair",
    segment_lengths_m=TARTANAIR_LENGTHS_M,
    segment_step_frames=1,
    segment_mean="macro",
)
# The settings with which other tools score, so that their numbers come out here.
# Sources: each tool's own defaults, as its code has them; docs/metrics.md has the table.
LIKE: dict[str, ScoreSettings] = {
    "evo": ScoreSettings(
        alignment="none",
        association="evo",
        max_diff_ns=10_000_000,
        rpe_delta=1.0,
        rpe_unit="f",
        rpe_pairs_from="est",
        rpe_rule="evo",
    ),
    "kitti": ScoreSettings(
        alignment="none",
        segment_lengths_m=KITTI_LENGTHS_M,
        segment_step_frames=KITTI_STEP_FRAMES,
        segment_precision="devkit",
    ),
    "rpg": ScoreSettings(
        alignment="sim3",
        association="greedy",
        max_diff_ns=20_000_000,
        relative_rule="rpg",
        full=True,
    ),
    "tum": ScoreSettings(
        alignment="se3",
        association="greedy",
        max_diff_ns=20_000_000,
        rpe_delta=1.0,
        rpe_unit="s",
        rpe_all_pairs=True,
        rpe_pairs_from="est",
        rpe_rule="tum",
    ),
    "openvins": ScoreSettings(
        alignment="yaw",
        association="in_order",
        max_diff_ns=20_000_000,
        relative_rule="openvins",
        std_ddof=1,
        full=True,
    ),
    "tartanair": _TARTANAIR,
    "tartanair_mono": replace(_TARTANAIR, scale_rule="tartanair"),
}
