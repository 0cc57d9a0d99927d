"""The position of an estimator in its run, which determines its colour in figures and in Rerun."""

from collections.abc import Iterable, Sequence


def estimator_positions(listed: Sequence[str], estimators: Iterable[str]) -> dict[str, int]:
    """The positions of estimators by name, in the order of the suite's list; those that it lacks come last, sorted."""
    names = set(estimators)
    further = sorted(names.difference(listed))
    in_order = [name for name in listed if name in names] + further
    return {name: position for position, name in enumerate(in_order)}
