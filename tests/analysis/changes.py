"""Changes of an error for tests."""

from vobench.analysis.explanation import Change


def change(*removed: str, reduction: float = 0.5, is_sure: bool = True, high: float = 0.9, loss: float = 0.1) -> Change:
    p = 0.01 if is_sure else 0.2
    low = 0.1 if is_sure else -0.1
    p_more = 0.01 if reduction < 0 else 0.9
    return Change(removed, loss, reduction, low, high, 1, 6, p_less=p, p_more=p_more, is_confirmed=True)
