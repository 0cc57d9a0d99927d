"""The layout of csv files with stamped poses, inferred from their header and stamps."""

import re
from dataclasses import dataclass
from typing import NamedTuple

from vobench.trajectory.quaternion_columns import QuaternionOrder
from vobench.trajectory.stamp_text import StampUnit
from vobench.trajectory.text_table import NUMBER, Line, content_lines

SECONDS_UNIT = re.compile(r"\[\s*s(?:ec(?:onds?)?)?\s*\]")  # such as [s] or [sec]
LETTER_OF_WORD = re.compile(r"[a-df-z]", re.IGNORECASE)  # without e, which also occurs in numbers


@dataclass(frozen=True, slots=True)
class CsvLayout:
    """The lines below the header of a csv file, the unit of their stamps and the order of their quaternions."""

    lines: list[Line]
    unit: StampUnit
    order: QuaternionOrder


def csv_layout(text: str) -> CsvLayout:
    """The layout of a csv file. The header is optional; without one, quaternions are read as in EuRoC.

    The text must have a line with content.
    """
    lines = content_lines(text)
    header = _header(text, lines[0].text)
    if header is None:
        return CsvLayout(lines, _stamp_unit("", lines), "wxyz")
    rows = lines[1:] if header.is_first_row else lines
    return CsvLayout(rows, _stamp_unit(header.cells[0], rows), _quaternion_order(header.cells))


class _Header(NamedTuple):
    """The names of the columns in lower case, and whether they are in the first row rather than in a comment."""

    cells: list[str]
    is_first_row: bool


def _header(text: str, first_row: str) -> _Header | None:
    """The header of a csv file; None if it has none.

    Three kinds of header are recognised:
        #timestamp [ns],x,y,z,...     a comment on the first line
        t [s],x,y,z,...               the first row
        # recorded in March           the first row below a comment, which has fewer commas
        t [s],x,y,z,...
    """
    first_line = text.removeprefix("\ufeff").lstrip().partition("\n")[0]
    is_comment = first_line.startswith("#")
    has_fewer_commas = first_line.count(",") < first_row.count(",")
    has_number = any(NUMBER.fullmatch(cell.strip()) for cell in first_row.split(","))
    is_below_comment = is_comment and has_fewer_commas and not has_number

    names = first_row if is_below_comment else first_line.lstrip("#")
    if not LETTER_OF_WORD.search(names):
        return None
    cells = [cell.strip().lower() for cell in names.split(",")]
    return _Header(cells, is_first_row=is_below_comment or not is_comment)


def _stamp_unit(stamp_header: str, rows: list[Line]) -> StampUnit:
    """The unit of stamps: seconds if their header says so or a stamp has a decimal point, otherwise nanoseconds."""
    if "[ns]" in stamp_header.replace(" ", ""):
        return "ns"
    has_decimal_point = any("." in row.text.partition(",")[0] for row in rows)
    is_in_seconds = has_decimal_point or SECONDS_UNIT.search(stamp_header)
    return "s" if is_in_seconds else "ns"


def _quaternion_order(header_cells: list[str]) -> QuaternionOrder:
    """The order xyzw if the names of columns 4 to 7 end in x, y, z and w; otherwise wxyz, as in EuRoC."""
    names = [cell.partition("[")[0].strip() for cell in header_cells[4:8]]
    last_letters = [name[-1:] for name in names]
    return "xyzw" if last_letters == ["x", "y", "z", "w"] else "wxyz"
