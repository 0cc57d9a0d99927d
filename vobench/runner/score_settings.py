"""The settings of a score: the defaults or those of another tool, with changes."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

from vobench.errors import require_known
from vobench.metric.settings import LIKE, PAIRS_OF_RULE, Plane, ScoreSettings, Side, Unit
from vobench.trajectory.align import AlignmentKind
from vobench.trajectory.associate import Method

# The settings whose value is one of several names: a noun for the value, and the names.
NAMED = {
    "alignment": ("alignment", get_args(AlignmentKind)),
    "association": ("association", get_args(Method)),
    "rpe_unit": ("unit", get_args(Unit)),
    "rpe_pairs_from": ("side", get_args(Side)),
    "project": ("plane", get_args(Plane)),
}


def settings_like(preset: str | None = None, **changes: Any) -> ScoreSettings:
    """The settings of a preset of `LIKE`, or the defaults without a preset, with changes. A change of None is ignored.

    Some tools choose the pairs of RPE by a special rule (`rpe_rule`). If the changes include settings that the rule
    does not have, the default rule is used instead.

    Raises UnknownNameError for an unknown preset or value, and SettingError for values that cannot be measured.
    """
    if preset is not None:
        require_known("preset", preset, LIKE)
    for setting, (kind, names) in NAMED.items():
        if changes.get(setting) is not None:
            require_known(kind, changes[setting], names)

    base = ScoreSettings() if preset is None else LIKE[preset]
    changes = {name: value for name, value in changes.items() if value is not None}
    if base.rpe_rule in PAIRS_OF_RULE and not _keeps_rule(base, changes):
        changes["rpe_rule"] = ScoreSettings().rpe_rule
    return replace(base, **changes)


def _keeps_rule(base: ScoreSettings, changes: Mapping[str, Any]) -> bool:
    """Whether the rule of a tool still applies with the changes."""
    unit, all_pairs, side = PAIRS_OF_RULE[base.rpe_rule]
    known = {"rpe_unit": unit, "rpe_all_pairs": all_pairs, "rpe_pairs_from": side}
    for name, value in known.items():
        if changes.get(name, value) != value:
            return False
    excluded = "project" if base.rpe_rule == "tum" else "rpe_delta"
    return excluded not in changes
