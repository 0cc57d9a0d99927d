"""What each metric is: formula, source, the settings that change it, and what it can't see."""

from dataclasses import dataclass

POSES = ("alignment", "align_n", "scale_rule", "project", "association", "max_diff_ns", "offset_ns")
MOTIONS = ("rpe_delta", "rpe_unit", "rpe_all_pairs", "rpe_pairs_from", "rpe_rule", *POSES)
SEGMENTS = ("segment_lengths_m", "segment_step_frames", "segment_precision", "segment_mean", *POSES)
RELATIVE = ("relative_rule", *POSES)
TIMES = ("coverage_of", "association", "max_diff_ns", "offset_ns")

STURM_ATE, STURM_RPE = "Sturm et al. (2012), section V-B", "Sturm et al. (2012), section V-A"
ZHANG = "Zhang and Scaramuzza (2018), section IV"
GEIGER = "Geiger et al. (2012), section 3.2, and its development kit"
OURS = "this project"

HARTLEY = "Hartley et al. (2013), section 4.3; evo's rot_part"
STRASDAT = "Strasdat et al. (2010), section II, as a ratio of distances"
DRIFT = "where along the path an error was made: one early turn moves everything after it"
LOST = "frames without a pose: read coverage beside it"
ALL_PAIRS = "; like tartanair over all ordered pairs i, j, of which its own script draws 10,000 at random"
GLOBAL = "a slow drift that stays below the size of a step"


@dataclass(frozen=True, slots=True)
class MetricDefinition:
    """One metric: the settings that change it, what it is blind to, the statistic to quote, if only --full has it."""

    id: str
    title: str
    unit: str
    formula: str
    source: str
    settings: tuple[str, ...]
    blind: str
    headline: str = "rmse"
    full: bool = True

    @property
    def identity(self) -> str:
        """How the ids of its numbers begin: family.rest."""
        return self.id.replace("_", ".", 1)


_ALL = (
    MetricDefinition(
        "ate_trans",
        "absolute trajectory error, position",
        "m",
        "‖p_est − p_gt‖ of each aligned pose",
        STURM_ATE,
        POSES,
        f"{DRIFT}; {LOST}",
        full=False,
    ),
    MetricDefinition(
        "ate_rot",
        "absolute trajectory error, angle",
        "deg",
        "angle of R_est⁻¹ R_gt of each aligned pose",
        STURM_ATE,
        POSES,
        f"a roll that the alignment had to guess: read alignment.unobservable; {LOST}",
        full=False,
    ),
    MetricDefinition(
        "ate_rot_chordal",
        "absolute trajectory error, rotation as a matrix",
        "1",
        "‖R_est⁻¹ R_gt − I‖_F = 2√2 sin(angle / 2)",
        HARTLEY,
        POSES,
        f"the same as ate_rot on another scale; {LOST}",
    ),
    MetricDefinition(
        "ate_full",
        "absolute trajectory error, whole pose",
        "1",
        "‖T_est⁻¹ T_gt − I‖_F",
        "evo's full",
        POSES,
        f"metres and rotations are added: it changes with the unit of length; {LOST}",
    ),
    *(
        MetricDefinition(
            f"ate_{axis}",
            f"absolute trajectory error along the truth's {axis}",
            "m",
            f"{axis} of p_est − p_gt, with its sign",
            OURS,
            POSES,
            f"errors along the other axes; {LOST}",
        )
        for axis in ("x", "y", "z")
    ),
    *(
        MetricDefinition(
            f"ate_{axis}",
            f"absolute trajectory error in {axis}",
            "deg",
            f"{axis} of R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll), with its sign",
            ZHANG,
            POSES,
            f"the angles of rotations near 90° of pitch, where roll and yaw are one; {LOST}",
        )
        for axis in ("roll", "pitch", "yaw")
    ),
    MetricDefinition(
        "rpe_trans",
        "relative pose error, translation",
        "m",
        f"‖t‖ of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        STURM_RPE,
        MOTIONS,
        GLOBAL,
        full=False,
    ),
    MetricDefinition(
        "rpe_rot",
        "relative pose error, angle",
        "deg",
        f"angle of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        STURM_RPE,
        MOTIONS,
        GLOBAL,
        full=False,
    ),
    MetricDefinition(
        "rpe_rot_chordal",
        "relative pose error, rotation as a matrix",
        "1",
        "‖R − I‖_F of the same E as rpe_rot",
        HARTLEY,
        MOTIONS,
        GLOBAL,
    ),
    MetricDefinition(
        "rpe_full",
        "relative pose error, whole motion",
        "1",
        "‖E − I‖_F",
        "evo's full",
        MOTIONS,
        f"metres and rotations are added: it changes with the unit of length; {GLOBAL}",
    ),
    MetricDefinition(
        "rpe_point",
        "difference of the distances moved",
        "m",
        "| ‖q_j − q_i‖ − ‖p_j − p_i‖ |",
        "evo's point_distance",
        MOTIONS,
        "every direction: a motion of the right length to the wrong side has no error",
    ),
    MetricDefinition(
        "rpe_point_percent",
        "difference of the distances moved, of the true one",
        "%",
        "100 | ‖q_j − q_i‖ − ‖p_j − p_i‖ | / ‖q_j − q_i‖, pairs where the truth stood still left out",
        "evo's point_distance_error_ratio",
        MOTIONS,
        "every direction, and drift while the truth stands still",
    ),
    MetricDefinition(
        "kitti_t_rel",
        "translation drift per metre of path",
        "1",
        "‖t‖ of (T_est,ij)⁻¹ T_gt,ij / length, j the first frame further than the length along the true path",
        GEIGER,
        SEGMENTS,
        "jitter: it is small against segments of a hundred metres",
        headline="mean",
        full=False,
    ),
    MetricDefinition(
        "kitti_r_rel",
        "rotation drift per metre of path",
        "deg/m",
        "angle of (T_est,ij)⁻¹ T_gt,ij / length, segments as of kitti_t_rel",
        GEIGER,
        SEGMENTS,
        "jitter, and errors that turn back within a segment",
        headline="mean",
        full=False,
    ),
    MetricDefinition(
        "rel_trans",
        "translation error over parts of the path",
        "m",
        "‖t‖ of (T_gt,ij)⁻¹ T_est,ij, j nearest to the length along the true path",
        ZHANG,
        RELATIVE,
        "lengths are mixed: the longest decide",
    ),
    MetricDefinition(
        "rel_trans_percent",
        "translation error over parts of the path, of their length",
        "%",
        "100 ‖t‖ / length of the same parts",
        ZHANG,
        RELATIVE,
        "jitter on long parts",
        headline="mean",
    ),
    MetricDefinition(
        "rel_rot",
        "angle error over parts of the path",
        "deg",
        "angle of (T_gt,ij)⁻¹ T_est,ij",
        ZHANG,
        RELATIVE,
        "lengths are mixed: the longest decide",
    ),
    MetricDefinition(
        "rel_rot_per_m",
        "angle error over parts of the path, per metre",
        "deg/m",
        "angle / length of the same parts",
        ZHANG,
        RELATIVE,
        "jitter on long parts",
        headline="mean",
    ),
    MetricDefinition(
        "rel_yaw",
        "yaw error over parts of the path: the turn about gravity that inertia can't see",
        "deg",
        "|yaw| of the error turned into the world: R_est,j R_E R_est,j⁻¹ = Rz(yaw) Ry(pitch) Rx(roll); "
        "rpg's is the estimate's own world, openvins' the truth's",
        ZHANG,
        RELATIVE,
        "gravity is the z of the world: another vertical mixes it with rel_gravity",
    ),
    MetricDefinition(
        "rel_gravity",
        "tilt error over parts of the path: the turn against gravity that inertia sees",
        "deg",
        "√(pitch² + roll²) of the same rotation as rel_yaw",
        ZHANG,
        RELATIVE,
        "gravity is the z of the world: another vertical mixes it with rel_yaw",
    ),
    MetricDefinition(
        "scale_error",
        "scale error of the segments",
        "1",
        "‖p_j − p_i‖ / ‖q_j − q_i‖ − 1 of the segments of kitti_t_rel, with its sign",
        STRASDAT,
        SEGMENTS,
        "scale where a segment ends near where it began; an alignment with scale has taken the mean out",
        headline="mean",
    ),
    MetricDefinition(
        "scale_drift",
        "drift of the scale per metre of path",
        "1/m",
        "slope by least squares of log(1 + scale_error) over the true path, one number",
        STRASDAT,
        SEGMENTS,
        "a scale that goes up and comes down again",
        headline="mean",
    ),
    *(
        MetricDefinition(
            name,
            title,
            "1",
            f"{error}ᵀ P⁻¹ {error} of each pose, P the covariance that the estimator states",
            "Bar-Shalom et al. (2001), section 5.4",
            POSES,
            f"the size of the error: a large one that was announced is consistent; honest ones give {dof} on average",
            headline="mean",
        )
        for name, title, error, dof in (
            ("nees_pose", "consistency of the stated covariance", "e", "6"),
            ("nees_trans", "consistency of the stated covariance, position", "e_p", "3"),
            ("nees_rot", "consistency of the stated covariance, orientation", "e_R", "3"),
        )
    ),
    MetricDefinition(
        "coverage",
        "share of the recording with a pose",
        "1",
        "slots with a pose / slots; a slot is a true pose, or 0.2 s of truth with more than 33 poses a second",
        OURS,
        TIMES,
        "whether the poses are right",
        headline="ratio",
        full=False,
    ),
    MetricDefinition(
        "lost_aware",
        "accuracy with lost counted as failed, 1 best and 0 worst",
        "1",
        "A/2 of a failed run, 1/2 + A/2 of a survivor; A: mean of 1 − e / (fail_ratio · path), cut at 0, lost slots 0",
        OURS,
        ("fail_ratio", *TIMES, *POSES),
        "differences beyond fail_ratio of the path: all of them are failures",
        headline="score",
        full=False,
    ),
)
DEFINITIONS: dict[str, MetricDefinition] = {definition.id: definition for definition in _ALL}
