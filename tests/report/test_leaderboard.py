"""The law of ranking: no failed trial ever ranks before one that survived; and one table in every form."""

import io
import json
import math
import re
import time

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vobench.report import board_table, page
from vobench.report.board_formats import FORMATS
from vobench.report.board_latex import latex
from vobench.report.board_markdown import markdown
from vobench.report.board_metric import lost_aware
from vobench.report.board_records import as_csv, as_json
from vobench.report.cell import CaseFacts
from vobench.report.frame_statistics import EstimatorStatistics, summarize_frames
from vobench.report.leaderboard import board
from vobench.report.marks import marks
from vobench.runner.environment import Environment, Processor
from vobench.runner.folder import NO_SEQUENCE, NOT_APPLICABLE, STATUSES, SURVIVED, TrialScore
from vobench.runner.frames import COLUMNS, FRAMES, TIMES, FrameRow, new_table

CASES = ("a", "b")
BEGUN = [status for status in STATUSES if status not in (NOT_APPLICABLE, NO_SEQUENCE)]
ates = st.none() | st.floats(0, 1e6)
runs = st.fixed_dictionaries(
    {name: st.tuples(*[st.tuples(st.sampled_from(BEGUN), ates)] * len(CASES)) for name in ("p", "q", "r", "s")}
)


def scores_of(outcomes):
    return [
        TrialScore(
            case=case,
            variant={},
            estimator=name,
            repeat=0,
            status=status,
            reason="",
            coverage=1.0,
            frames=9,
            path_m=1.0,
            score=None if ate is None else {"metrics": [{"name": "ate_trans", "rmse": ate}]},
        )
        for name, results in outcomes.items()
        for case, (status, ate) in zip(CASES, results, strict=True)
    ]


def failed(results):
    return sum(status not in SURVIVED for status, _ in results)


@settings(max_examples=25)
@given(runs)
def test_no_failure_ranks_before_a_survivor_however_small_its_error(outcomes):
    made = board(scores_of(outcomes), {})
    lost = [total.failed for total in made.totals]
    assert lost == sorted(lost)
    places = {total.estimator: total.place for total in made.totals}
    for one in made.totals:
        for other in made.totals:
            if not one.failed and other.failed:
                assert places[one.estimator] < places[other.estimator]


@given(st.sampled_from(STATUSES), st.sampled_from(STATUSES), ates, ates)
def test_no_failed_trial_scores_more_than_one_that_survived(one, other, ate, its_ate):
    trials = scores_of({"p": [(one, ate)] * 2, "q": [(other, its_ate)] * 2})
    survivor, loser = trials[0], trials[2]
    if survivor.status in SURVIVED and loser.status not in SURVIVED:
        assert lost_aware(survivor) >= 0.5 >= lost_aware(loser)


@settings(max_examples=25)
@given(runs)
def test_everyone_who_ran_is_in_the_totals_once_and_in_every_case(outcomes):
    made = board(scores_of(outcomes), {})
    assert {total.estimator: total.failed for total in made.totals} == {n: failed(r) for n, r in outcomes.items()}
    assert sorted((cell.case, cell.estimator) for cell in made.cells) == sorted((c, n) for c in CASES for n in outcomes)


@settings(max_examples=25)
@given(runs, st.randoms(use_true_random=False))
def test_the_order_of_scores_does_not_matter(outcomes, random):
    shuffled = scores_of(outcomes)
    random.shuffle(shuffled)
    assert board(shuffled, {}) == board(scores_of(outcomes), {})


@given(st.floats(0, 0.1), st.floats(0, 0.1))
def test_among_survivors_the_smaller_error_is_first(one, other):
    totals = board(scores_of({"p": [("ok", one)] * 2, "q": [("ok", other)] * 2}), {}).totals
    if abs(one - other) > 1e-6:
        assert totals[0].estimator == ("p" if one < other else "q")


def test_an_error_is_never_averaged_over_paths_of_other_lengths(scored):
    """The one that is a tenth of its path off on 1 m and exact on 1 km is no better than the other way round."""
    ways = [("short", 1.0, "down", 0.09), ("short", 1000.0, "ahead", 1.0), ("long", 1.0, "down", 0.001)]
    ways.append(("long", 1000.0, "ahead", 90.0))
    made = board([scored(name, case=case, path_m=path, ate_m=ate) for name, path, case, ate in ways], {})
    assert [total.place for total in made.totals] == [1, 1]
    assert [total.ate_percent for total in made.totals] == pytest.approx([4.55, 4.55])


def test_a_cell_shows_the_median_and_range_of_its_trials_and_how_many_failed(scored):
    trials = [scored("a", repeat=n, ate_m=ate) for n, ate in enumerate((0.02, 0.01, 0.05))]
    (shown,) = board_table.matrix(board(trials, {}), "ate_mm")[0][1]
    assert (shown.text, shown.range) == ("20.0", "10.0–50.0")
    (shown,) = board_table.matrix(board([*trials, scored("a", "lost", repeat=3)], {}), "ate_mm")[0][1]
    assert str(shown) == "20.0 (10.0–50.0, 1/4 lost)"
    (shown,) = board_table.matrix(board([scored("a", "crashed", repeat=n, ate_m=None) for n in (0, 1)], {}), "ate")[0][
        1
    ]
    assert (str(shown), shown.failed) == ("2/2 crashed", True)


def test_the_best_of_a_case_is_marked_and_whoever_is_not_decided_against_it(scored):
    def trials(name, errors):
        return [scored(name, repeat=n, ate_m=ate) for n, ate in enumerate(errors)]

    few = board([*trials("a", [0.01]), *trials("b", [0.02])], {})
    assert marks(few, "ate") == {("down", "a"): "*~"}
    near = trials("b", [0.0105, 0.0125, 0.0135, 0.0145])
    many = board([*trials("a", [0.01, 0.011, 0.012, 0.013]), *near, *trials("c", [0.2, 0.3, 0.4, 0.5])], {})
    assert marks(many, "ate") == {("down", "a"): "*~", ("down", "b"): "~"}
    assert marks(board([s for s in near if s.estimator == "b"] + trials("c", [0.2, 0.3, 0.4, 0.5]), {}), "ate") == {
        ("down", "b"): "*"
    }


def test_who_lacks_a_sensor_in_some_cases_is_ranked_on_the_others_and_in_all_of_them_behind(scored):
    trials = [scored("blind", ate_m=0.9), scored("blind", case="flat", ate_m=0.9), scored("wheels", ate_m=0.01)]
    unfit = scored("wheels", "not_applicable", case="flat", ate_m=None, coverage=0.0)
    made = board([*trials, unfit], {})
    assert [(total.estimator, total.failed, total.cases) for total in made.totals] == [
        ("wheels", 0, 1),
        ("blind", 0, 1),
    ]
    assert "Totals cover the 1 of 2 cases that all estimators share (wheels has 1)" in made.remarks[0]
    everywhere = [scored("wheels", "not_applicable", case=case, ate_m=None, coverage=0.0) for case in ("down", "flat")]
    last = board([*trials[:2], *everywhere], {}).totals[-1]
    assert (last.estimator, last.failed) == ("wheels", 2)


@pytest.fixture
def incomplete(scored):
    """Two estimators on a case that was simulated, and on three that were not, for two causes."""
    causes = {"dark": "no light", "dim": "no light", "far": "too far"}
    return [
        scored(name, case=case, ate_m=ate_m)
        if case == "down"
        else scored(name, NO_SEQUENCE, case=case, ate_m=None, reason=causes[case])
        for name, ate_m in (("a", 0.01), ("b", 0.02))
        for case in ("down", *causes)
    ]


def test_cases_without_a_sequence_are_one_sentence_and_change_nothing_else(incomplete):
    made = board(incomplete, {})
    complete = board([score for score in incomplete if score.case == "down"], {})
    assert (made.cells, made.totals) == (complete.cells, complete.totals)
    assert made.remarks == (
        "3 of 4 cases could not be simulated or imported and count for no estimator: dark, dim: no light; far: too far",
        *complete.remarks,
    )


@pytest.mark.parametrize("form", FORMATS)
def test_every_form_but_a_table_for_a_paper_says_which_cases_have_no_sequence(incomplete, form):
    text = FORMATS[form](board(incomplete, {}), "ate")
    assert ("no light" in text) == (form != "latex")
    assert "a" in text


def test_a_board_without_any_sequence_is_empty_and_says_why(incomplete):
    made = board([score for score in incomplete if score.case != "down"], {})
    assert (made.cells, made.totals) == ((), ())
    for form, write in FORMATS.items():
        assert write(made, "ate"), form


@pytest.fixture
def placed(scored):
    """A board of which is known where it was made."""
    here = Environment(
        vobench="1.0", processors=(Processor("Some_CPU 9", "x86-64-v3"),), drawn_by=("pipe & co",), date="2026-11-24"
    )
    return board([scored("a"), scored("b")], {}, environment=here)


@pytest.mark.parametrize("form", FORMATS)
def test_every_form_names_processor_driver_and_date(placed, form):
    text = FORMATS[form](placed, "ate")
    for part in ("CPU 9", "x86-64-v3", "pipe", "2026-11-24"):
        assert part in text


def test_in_csv_the_origin_is_columns_of_every_row(placed):
    frame = pd.read_csv(io.StringIO(as_csv(placed)))
    assert set(frame.processor) == {"Some_CPU 9"}
    assert set(frame.simd) == {"x86-64-v3"}
    assert len(frame) == 4


def test_in_latex_the_origin_is_a_comment(placed):
    (line,) = [line for line in latex(placed).splitlines() if "Some_CPU" in line]
    assert line.startswith("% Made on Some_CPU 9 (x86-64-v3), ")


def test_csv_has_a_row_for_each_case_without_a_sequence(incomplete):
    frame = pd.read_csv(io.StringIO(as_csv(board(incomplete, {}))))
    unmade = frame[frame.status == NO_SEQUENCE]
    assert dict(zip(unmade.case, unmade.reason, strict=True)) == {
        "dark": "no light",
        "dim": "no light",
        "far": "too far",
    }


def test_totals_are_over_the_cases_that_all_have_and_say_so(scored):
    made = board([scored("a"), scored("a", case="ahead"), scored("b")], {})
    assert {total.cases for total in made.totals} == {1}
    assert "Totals cover the 1 of 2 cases that all estimators share (b has 1)" in made.remarks[0]


def test_estimators_that_share_no_case_are_not_ranked(scored):
    made = board([scored("a"), scored("b", case="ahead")], {})
    assert made.totals == ()
    assert "No estimator is ranked" in made.remarks[0]
    assert "| ahead |" in markdown(made)


def test_calibrations_have_totals_of_their_own(scored):
    facts = {"down": CaseFacts(group="none"), "ahead": CaseFacts(group="worn")}
    made = board([scored(n, case=case) for n in "ab" for case in facts], {}, facts)
    assert [(total.group, total.cases) for total in made.totals] == [("none", 1)] * 2 + [("worn", 1)] * 2


def test_a_scenario_says_at_which_severity_each_estimator_breaks(scored):
    facts = {f"s{k}": CaseFacts(scenario="blur", severity=k) for k in range(4)}
    strong = [scored("strong", case=case, ate_m=0.001) for case in facts]
    weak = [scored("weak", "ok" if k < 2 else "lost", case=f"s{k}", ate_m=0.001) for k in range(4)]
    made = board([*strong, *weak], {}, facts)
    assert {curve.estimator: curve.breaks_at for curve in made.curves} == {"strong": None, "weak": 2}
    assert "blur, severity 0 to 3: weak breaks down at 2 (scores 0.99, 0.99, 0.49, 0.49)" in board_table.remarks(made)


def test_whoever_is_cheaper_than_all_before_is_efficient(scored):
    costs = {"a": 10.0, "b": 20.0, "c": 5.0}
    answered = {("down", name): EstimatorStatistics(cost) for name, cost in costs.items()}
    made = board([scored(n, ate_m=ate) for n, ate in (("a", 0.001), ("b", 0.002), ("c", 0.003))], answered)
    assert [(total.estimator, total.is_efficient) for total in made.totals] == [("a", True), ("b", False), ("c", True)]


def test_one_that_never_survived_has_no_error_and_a_reason(mixed):
    made = board(mixed, {})
    dead = made.totals[-1]
    assert (dead.estimator, dead.failed, dead.trials, dead.ate_percent) == ("dead", 2, 2, None)
    assert made.cell("down", "dead").status == "crashed"


@settings(max_examples=25)
@given(runs, st.floats(0, 1e3))
def test_a_case_that_stands_still_changes_no_error_and_no_rank(outcomes, drift_m):
    """Nothing but whether it was survived counts of it."""
    moving = scores_of(outcomes)
    still = [
        s.model_copy(update={"case": "still", "drift_m": drift_m, "status": "ok"}) for s in moving if s.case == "a"
    ]
    before, after = (board(scores, {}).totals for scores in (moving, [*moving, *still]))
    shown = [[(t.place, t.estimator, round(t.score, 9), t.ate_percent) for t in each] for each in (before, after)]
    assert shown[0] == shown[1]


def test_a_still_case_shows_the_largest_drift_of_its_trials_and_no_error(scored):
    scores = [scored("a", repeat=n, drift_m=drift, ate_m=9.0) for n, drift in enumerate((0.0023, 0.001))]
    (cell,) = board(scores, {}).cells
    assert (cell.drift_mm, cell.spread("ate_mm"), cell.failed) == (2.3, None, 0)


def frames(*reasons):
    return [
        FrameRow(10 + k, k, "lost", reason, None, None, None, None, None, None, "{}", 1.0, 2.0)
        for k, reason in enumerate(reasons)
    ]


def test_the_commonest_reason_of_frames_is_counted_whatever_its_numbers():
    rows = frames("", "blurred", "too few tracks (7)", "", "too few tracks (-1.5e3)", "too few tracks")
    assert summarize_frames([rows]) == EstimatorStatistics(2.0, "too few tracks (7)", 2, 12, frames=6)


def test_frames_without_a_reason_have_none_and_no_frame_no_answer():
    assert summarize_frames([frames("", ""), []]) == EstimatorStatistics(2.0, frames=2)
    assert summarize_frames([[], []]) == EstimatorStatistics()


@pytest.fixture
def made(run, mixed):
    return page.board_of(run, mixed)


def test_json_holds_every_cell_and_total_in_full(made):
    read = json.loads(as_json(made))
    assert [(c["case"], c["estimator"], c["status"]) for c in read["cells"]] == [
        (cell.case, cell.estimator, cell.status) for cell in made.cells
    ]
    assert [(t["estimator"], t["score"]) for t in read["totals"]] == [(t.estimator, t.score) for t in made.totals]
    assert next(c["ate"] for c in read["cells"] if c["estimator"] == "good_one") == pytest.approx(10)


def test_csv_is_read_by_pandas_with_gaps_where_there_is_no_number(made):
    read = pd.read_csv(io.StringIO(as_csv(made)))
    assert list(read["estimator"]) == [cell.estimator for cell in (*made.cells, *made.totals)]
    errors = [math.nan if (s := cell.spread("ate")) is None else s[0] for cell in made.cells]
    assert list(read["ate"])[: len(errors)] == pytest.approx(errors, rel=1e-12, nan_ok=True)
    assert list(read["place"].dropna()) == [total.place for total in made.totals]


def test_markdown_has_as_many_cells_in_every_line_of_a_table(made):
    text = markdown(made)
    for table in text.split("\n\n"):
        if table.startswith("|"):
            assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1
    assert "- down: mad: diverged: it went dark" in text
    assert "lost" not in text.split("## Totals")[0] or "crashed" in text


HOSTILE = "<script>alert(1)</script>|&_%$#{}~^\\\x1b[2J\0"


@pytest.mark.parametrize("form", [*FORMATS, "html"])
def test_a_hostile_name_and_reason_harm_no_form(tmp_path, scored, write_run, form):
    scores = [scored("<script>", "crashed", ate_m=None, reason=HOSTILE), scored("fine")]
    folder = write_run(tmp_path / "suite" / "stamp", scores)
    made = page.board_of(folder, scores)
    text = page.html(folder, scores, made, tmp_path) if form == "html" else FORMATS[form](made, "ate")
    assert not {"\x1b", "\0"} & set(text)
    if form in ("md", "html"):
        assert "<script>alert" not in text
        assert not re.search(r"(?<!\\)<script>(?![\s\S]*</script>)", text)
    if form == "latex":
        assert "<" not in text.replace("$<$", "")


def test_latex_is_a_table_with_caption_label_and_every_special_character_escaped(made):
    text = latex(made)
    assert text.count("\\caption{") == text.count("\\label{tab:suite}") == 1
    assert re.search(r"\\begin\{tabular\}\{lr+\}", text)
    rows = [line for line in text.splitlines() if line.endswith("\\\\")]
    assert len({len(re.findall(r"(?<!\\)&", row)) for row in rows}) == 1
    assert r"\textbf{" in text
    assert r"good\_one" in text
    assert not re.search(r"(?<!\\)[_%#]", "\n".join(rows))


def test_the_reports_of_a_run_are_written_beside_it(run, mixed):
    page.write_reports(run, mixed)
    assert {path.suffix for path in run.path.glob("leaderboard.*")} == {".md", ".json", ".csv", ".html"}
    assert json.loads((run.path / "leaderboard.json").read_text(encoding="utf-8"))


def test_no_time_stands_in_a_report_but_in_a_file_of_its_own_and_in_the_page(run, mixed):
    page.write_reports(run, mixed)
    said = {path.suffix: path.read_text(encoding="utf-8") for path in run.path.glob("leaderboard.*")}
    assert "CPU" in said.pop(".html")
    assert "CPU" not in said[".md"]
    assert {cell["cpu_ms"] for cell in json.loads(said[".json"])["cells"]} == {None}
    with (run.path / TIMES).open(encoding="utf-8") as file:
        assert {line.split(",")[3] for line in file} == {"cpu_ms", "2.000", ""}


@pytest.mark.parametrize("form", ["md", "html", "csv", "json"])
def test_every_report_says_the_drift_of_a_still_case_and_the_commonest_reason_of_frames(
    tmp_path, scored, write_run, form
):
    scores = [scored("still_one", drift_m=0.00234, ate_m=5.0), scored("moving_one", case="ahead")]
    folder = write_run(tmp_path / "suite" / "stamp", scores)
    with new_table(folder.estimate("down", "still_one", 0) / FRAMES, COLUMNS) as table:
        table.writerows({"frame": k, "t_ns": k, "status": "lost", "reason": f"few <{9 - 2 * k}>"} for k in (1, 2))
    page.write_reports(folder, scores)
    text = (folder.path / f"leaderboard.{form}").read_text(encoding="utf-8")
    if form == "md":
        assert "still_one: drift of 2.3 mm while the camera is stationary" in text
        assert 'still_one: 2 frames with "few &lt;7>", first in frame 1' in text
    elif form == "html":
        data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
        assert 'still_one: 2 frames with "few <7>", first in frame 1' in str(data["details"])
    elif form == "csv":
        (row,) = pd.read_csv(io.StringIO(text)).query("estimator == 'still_one' and case == 'down'").to_dict("records")
        assert (row["drift_mm"], row["frame_reason"], row["frame_reason_count"]) == (2.34, "few <7>", 2)
    else:
        (row,) = (c for c in json.loads(text)["cells"] if c["estimator"] == "still_one")
        assert (row["drift_mm"], row["ate_mm"], row["frame_reason_first"]) == (2.34, None, 1)


@pytest.mark.parametrize(("cases", "estimators"), [(2500, 4), (5, 2000)])
def test_the_work_of_a_board_is_no_square_of_its_cases_or_estimators(cases, estimators):
    """Five times as many take five times as long, with a constant and noise; a square would take 25 times as long."""
    fewer_cases, fewer_estimators = (cases // 5, estimators) if cases > estimators else (cases, estimators // 5)
    _, fewer_s = timed_board(fewer_cases, fewer_estimators)
    made, all_s = timed_board(cases, estimators)
    assert all_s < 12 * fewer_s
    assert len(made.totals) == estimators
    assert len(made.cells) == 10_000


def timed_board(cases, estimators):
    """A board of as many trials, and the CPU seconds that it took."""
    one = scores_of({"e": [("ok", 0.1)] * len(CASES)})[0]
    trials = [
        one.model_copy(
            update={
                "case": f"c{k}",
                "estimator": f"e{n}",
                "score": {"metrics": [{"name": "ate_trans", "rmse": 0.0001 * (1 + n % 97)}]},
            }
        )
        for k in range(cases)
        for n in range(estimators)
    ]
    began = time.process_time()
    made = board(trials, {})
    return made, time.process_time() - began
