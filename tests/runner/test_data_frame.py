"""Rows of results as a table."""

from vobench.runner.data_frame import data_frame


def test_each_mapping_is_a_row_and_its_keys_are_the_columns_in_their_order():
    frame = data_frame({"name": name, "value": value} for name, value in (("b", 2.0), ("a", None)))
    assert list(frame.columns) == ["name", "value"]
    assert frame["name"].tolist() == ["b", "a"]
    assert frame["value"].isna().tolist() == [False, True]


def test_no_rows_are_an_empty_table():
    assert data_frame([]).empty
