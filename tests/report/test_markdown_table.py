"""Tables and text in Markdown."""

import pytest

from vobench.report.markdown_table import escaped, markdown_table


def test_a_table_has_its_headings_a_rule_and_its_rows():
    lines = markdown_table([["case", "a", "b"], ["x", "1", "2"]], words=1)
    assert lines == ["| case | a | b |", "|---|---:|---:|", "| x | 1 | 2 |"]
    assert markdown_table([["a"]], words=1) == ["| a |", "|---|"]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a|b", r"a\|b"),
        ("2*3", r"2\*3"),
        ("~ `x`", r"\~ \`x\`"),
        ("a\\b", r"a\\b"),
        ("<b> & c", "&lt;b> &amp; c"),
        ("two\nlines", "two lines"),
        ("plain_text", "plain_text"),
    ],
)
def test_text_is_shown_as_it_is(text, shown):
    assert escaped(text) == shown
