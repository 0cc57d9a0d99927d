"""Converts results to pandas tables."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import pandas as pd

    DataFrame: TypeAlias = pd.DataFrame


def data_frame(rows: Iterable[Mapping[str, Any]]) -> "DataFrame":
    """A table with one row per mapping. Its columns are the keys, in the order of the first row."""
    import pandas as pd

    return pd.DataFrame(list(rows))
