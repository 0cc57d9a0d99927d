"""What is known of each pair of estimators whose units were drawn until decided, in sentences."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from vobench.metric.ranking import DECIDED
from vobench.metric.sequential import PairState, PairVerdict, pair_verdicts
from vobench.report.cell import Cell
from vobench.report.division import divisions
from vobench.report.total import ranked_table

PHRASES = {
    PairState.FIRST_BETTER: "decided",
    PairState.SECOND_BETTER: "decided",
    PairState.EQUIVALENT: "alike within {ratio:g} ×",
    PairState.OPEN: "open",
}


@dataclass(frozen=True, slots=True)
class NamedPair:
    """A pair of estimators of a division, `first` with the smaller loss, and what is known of it."""

    first: str
    second: str
    known: PairVerdict

    def as_dict(self) -> dict[str, str | float | int]:
        """The pair as a row of a table."""
        low, high = self.known.interval
        return {
            "first": self.first,
            "second": self.second,
            "ratio": self.known.loss_ratio,
            "low": low,
            "high": high,
            "places": self.known.units,
            "verdict": PHRASES[self.known.verdict].format(ratio=self.known.ratio),
        }

    @property
    def sentence(self) -> str:
        """What is known of the pair, with the interval of the ratio of losses, at all times."""
        if self.known.units == 0:
            return f"{self.second} and {self.first}: no unit has both"
        low, high = self.known.interval
        ratio = f"{self.known.loss_ratio:.3g}"
        interval = f"[{low:.3g}, {high:.3g}]" if self.known.has_interval else "(too few units for an interval)"
        phrase = PHRASES[self.known.verdict].format(ratio=self.known.ratio)
        return f"{self.second} has {ratio} × {self.first}'s loss {interval}: {phrase}"


def named_pairs(cells: Sequence[Cell], *, ratio: float) -> list[NamedPair]:
    """What is known of all pairs of ranked estimators of each division, with a false statement in 2 % of boards."""
    tables = [ranked_table(members) for members in divisions(cells).values()]
    comparable = [(names, table) for names, table in tables if table is not None and len(names) > 1]
    pair_count = sum(len(names) * (len(names) - 1) // 2 for names, _ in comparable)
    pairs = list[NamedPair]()
    for names, table in comparable:
        of_division = len(names) * (len(names) - 1) // 2
        alpha = DECIDED * of_division / pair_count
        for known in pair_verdicts(table.log_losses(), ratio=ratio, alpha=alpha):
            pairs.append(_better_first(names, known))
    return pairs


def _better_first(names: Sequence[str], known: PairVerdict) -> NamedPair:
    """The pair with the estimator of smaller loss first."""
    if known.loss_ratio >= 1:
        return NamedPair(names[known.first], names[known.second], known)
    swapped = replace(
        known,
        first=known.second,
        second=known.first,
        differences=tuple(-difference for difference in known.differences),
    )
    return NamedPair(names[known.second], names[known.first], swapped)
