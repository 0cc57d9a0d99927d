"""A board as a LaTeX table."""

import re

import pytest

from vobench.report import page
from vobench.report.board_latex import latex
from vobench.report.cell import CaseFacts
from vobench.report.leaderboard import make_board


@pytest.fixture
def made(run, mixed):
    return page.run_board(run, mixed)


def test_latex_is_a_table_with_caption_label_and_every_special_character_escaped(made):
    text = latex(made)
    assert text.count("\\caption{") == text.count("\\label{tab:suite}") == 1
    assert re.search(r"\\begin\{tabular\}\{lr+\}", text)
    rows = [line for line in text.splitlines() if line.endswith("\\\\")]
    assert len({len(re.findall(r"(?<!\\)&", row)) for row in rows}) == 1
    assert r"\textbf{" in text
    assert r"good\_one" in text
    assert not re.search(r"(?<!\\)[_%#]", "\n".join(rows))


def test_in_latex_the_origin_is_a_comment(placed):
    (line,) = [line for line in latex(placed).splitlines() if "Some_CPU" in line]
    assert line.startswith("% Made on Some_CPU 9 (x86-64-v3), ")


def rows_of(text):
    return [line.removesuffix(r" \\").split(" & ") for line in text.splitlines() if line.endswith(r"\\")]


def several(scored, estimators, cases, **changes):
    return [
        scored(f"e{n}", case=f"c{k}", ate_m=0.01 * (n + 1), **changes) for n in range(estimators) for k in range(cases)
    ]


def test_whichever_are_fewer_are_the_columns(scored):
    tall = rows_of(latex(make_board(several(scored, 2, 3), {})))
    assert tall[0] == ["", "e0", "e1"]
    assert [row[0] for row in tall[1:]] == ["c0", "c1", "c2", "score", "rank"]
    wide = rows_of(latex(make_board(several(scored, 3, 2), {})))
    assert wide[0] == ["", "c0", "c1", "score", "rank"]
    assert [row[0] for row in wide[1:]] == ["e0", "e1", "e2"]
    square = rows_of(latex(make_board(several(scored, 2, 2), {})))
    assert square[0] == ["", "e0", "e1"]


def test_a_rule_parts_cases_from_totals_where_the_totals_are_rows(scored):
    assert latex(make_board(several(scored, 2, 3), {})).count(r"\midrule") == 2
    assert latex(make_board(several(scored, 3, 2), {})).count(r"\midrule") == 1


@pytest.mark.parametrize(
    ("columns", "name", "is_rotated", "environment"),
    [
        (3, "constant_model", False, "table"),
        (4, "constant_model", True, "table"),
        (8, "model", False, "table*"),
        (8, "constant_model", True, "table*"),
    ],
)
def test_names_are_rotated_and_a_table_spans_the_page_where_a_column_of_a_paper_is_too_narrow(
    scored, columns, name, is_rotated, environment
):
    names = [f"{name}{number}" for number in range(columns)]
    trials = [scored(estimator, case=f"c{case}", path_m=0.01) for estimator in names for case in range(columns)]
    text = latex(make_board(trials, {}))
    assert text.count(r"\rotatebox{90}{") == (columns if is_rotated else 0)
    assert rf"\begin{{{environment}}}" in text
    assert rf"\end{{{environment}}}" in text
    assert r"\begin{tabular}{l" + "r" * columns + "}" in text


def test_latex_shrinks_a_table_that_is_too_wide_for_its_column(scored):
    lines = latex(make_board([scored("a")], {})).splitlines()
    assert lines[0] == r"% Needs \usepackage{booktabs} and \usepackage{graphicx}."
    box = lines.index(r"\sbox0{%")
    assert lines[box + 1].startswith(r"\begin{tabular}")
    end = lines.index(r"\end{tabular}}%")
    assert lines[end + 1] == r"\ifdim\wd0>\linewidth\resizebox{\linewidth}{!}{\usebox0}\else\usebox0\fi"


def test_a_table_without_ranges_still_tells_how_many_trials_failed(scored):
    trials = several(scored, 4, 4)
    failures = [scored("e0", "lost", case="c0", repeat=1, ate_m=0.3), scored("e1", case="c1", repeat=1, ate_m=0.2)]
    text = latex(make_board([*trials, *failures], {}))
    assert text.count(r"{\tiny") == text.count(r"{\tiny 1/2 lost}") == 1


@pytest.mark.parametrize(("columns", "has_range"), [(3, True), (4, False)])
def test_ranges_are_shown_where_at_most_three_columns_need_room(scored, columns, has_range):
    trials = several(scored, columns, columns)
    worse = {"metrics": [{"name": "ate_trans", "rmse": 0.2}]}
    again = [trial.model_copy(update={"repeat": 1, "score": worse}) for trial in trials]
    text = latex(make_board([*trials, *again], {}))
    assert (r"{\tiny" in text) == has_range
    assert (", median and range of its trials" in text) == has_range
    assert ", median" in text
    assert ", median" not in latex(make_board(trials, {}))


def test_best_is_bold_failures_are_italic_and_undecided_ones_have_a_tilde(scored):
    trials = []
    for repeat in range(4):
        trials.append(scored("a", repeat=repeat, ate_m=0.01 + 1e-6 * repeat))
        trials.append(scored("b", repeat=repeat, ate_m=0.02 * (0.4 if repeat == 0 else 1.0) + 1e-6 * repeat))
    text = latex(make_board([*trials, scored("c", "lost")], {}))
    assert r"\textbf{1.00}$^{\sim}$" in text
    assert r"\textit{lost}" in text
    assert r"2.00$^{\sim}$ {\tiny 0.800--2.00}" in text


def test_calibration_groups_have_no_totals_in_the_table(scored):
    facts = {"c0": CaseFacts(group="worn"), "c1": CaseFacts()}
    assert "score" not in latex(make_board(several(scored, 2, 2), {}, facts))


def test_an_estimator_without_a_total_leaves_all_totals_out(scored):
    facts = {"c0": CaseFacts(group="worn")}
    trials = [scored("a", case="c0"), scored("b", case="c1"), scored("c", case="c2")]
    assert "score" not in latex(make_board(trials, {}, facts))


def test_a_letter_that_a_paper_may_not_have_is_a_question_mark(scored):
    text = latex(make_board([scored("名", case="a<b|c>d^e~f\\g{h}")], {}))
    assert "? " in text
    assert r"a$<$b$|$c$>$d\textasciicircum{}e\textasciitilde{}f\textbackslash{}g\{h\}" in text
    assert r"$^\circ$" in latex(make_board([scored("a")], {}), "rpe_deg")


def test_the_label_is_the_title_in_plain_letters(scored):
    assert r"\label{tab:my-suite-2}" in latex(make_board([scored("a")], {}, title="my suite_2"))
    assert r"\label{tab:board}" in latex(make_board([scored("a")], {}))


def test_an_empty_board_is_a_table_without_rows():
    assert rows_of(latex(make_board([], {}))) == [[""]]
