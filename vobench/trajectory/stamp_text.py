"""Time stamps as text, exact to the nanosecond."""

import re
from decimal import ROUND_HALF_EVEN, Context, Decimal
from typing import Literal

import numpy as np

from vobench.errors import TrajectoryError
from vobench.trajectory.increasing_column import require_steps
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.text_table import TextTable
from vobench.trajectory.trajectory import Stamps

StampUnit = Literal["s", "ms", "us", "ns"]

UNIT_NAMES: dict[StampUnit, str] = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
DECIMALS_OF_UNIT: dict[StampUnit, int] = {"s": 9, "ms": 6, "us": 3, "ns": 0}  # needed to resolve 1 ns
MAX_NS = 2**63 - 1
# Seconds with one to nine decimals, as in most files. The integer part is limited so that the stamp is below MAX_NS.
PLAIN_SECONDS = re.compile(r"([0-9]{1,9}|[0-8][0-9]{9})\.([0-9]{1,9})")
EXACT = Context(prec=64, rounding=ROUND_HALF_EVEN)  # int64 nanoseconds need only 19 digits


def format_seconds(t_ns: int) -> str:
    """A time in nanoseconds as text in seconds, exact with 9 decimals."""
    whole_s, fraction_ns = divmod(abs(t_ns), NS_PER_S)
    sign = "-" if t_ns < 0 else ""
    return f"{sign}{whole_s}.{fraction_ns:09d}"


def stamps_ns(table: TextTable, unit: StampUnit) -> Stamps:
    """The stamps (N,) in the first column of a table.

    Raises TrajectoryError if a stamp is not greater than the one before it, or if it exceeds int64.
    """
    t_ns = unchecked_stamps_ns(table, unit)
    require_steps(table, t_ns, least_step=1, demand="stamps must increase by 1 ns or more")
    return t_ns


def unchecked_stamps_ns(table: TextTable, unit: StampUnit) -> Stamps:
    """The stamps (N,) in the first column, in any order. Raises TrajectoryError if a stamp exceeds int64."""
    stamps = [_stamp_ns(text, unit, table.place(row)) for row, text in enumerate(table.first_fields)]
    return np.array(stamps, np.int64)


def _stamp_ns(text: str, unit: StampUnit, place: str) -> int:
    """A stamp, rounded to the nanosecond with ties to even. Raises TrajectoryError if it exceeds int64."""
    if unit == "s" and (plain := PLAIN_SECONDS.fullmatch(text)):
        whole_s = int(plain[1])
        fraction_ns = int(plain[2].ljust(9, "0"))
        return whole_s * NS_PER_S + fraction_ns
    decimals = DECIMALS_OF_UNIT[unit]
    t_ns = Decimal(text).scaleb(decimals, EXACT)
    if abs(t_ns) > MAX_NS:
        limit = Decimal(MAX_NS).scaleb(-decimals, EXACT)
        raise TrajectoryError(
            f"{place}: t should be {UNIT_NAMES[unit]} below {limit}, but is {text} (is it in another unit?)"
        )
    return int(t_ns.to_integral_value(context=EXACT))
