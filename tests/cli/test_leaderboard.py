"""vobench leaderboard: published bundles, a user's run among them, and submissions that are refused."""

import json
import shutil

import pytest

from tests.forgery import forger_of

TRIAL = "cases/short/estimates/stand_still/0"
TRUTH = "cases/short/ground_truth.tum"
OTHER_PROCESSOR = {"processors": [{"model": "Another processor", "simd": "x86-64-v2"}]}


@pytest.fixture
def published(vobench, ran, here):
    """The bundle of a run in results/tiny."""
    path = here / "results" / "tiny" / "builtin.zip"
    path.parent.mkdir(parents=True)
    assert vobench("bundle", ran, path).code == 0
    return path


@pytest.fixture
def boards(vobench):
    """Prints the leaderboards of results/."""

    def run(*words):
        return vobench("leaderboard", "--results", "results", *words)

    return run


def with_only(bundle, path, estimator, *, environment=None):
    """Write a bundle of one of the estimators of another bundle, with another label."""
    forger = forger_of(bundle)
    for name in list(forger.files):
        if "/estimates/" in name and f"/{estimator}/" not in name:
            del forger.files[name]
    forger.edit(f"cases/short/estimates/{estimator}/0/score.json", estimator="mine")
    for name in [name for name in forger.files if f"/{estimator}/" in name]:
        forger.files[name.replace(f"/{estimator}/", "/mine/")] = forger.files.pop(name)
    forger.edit("environment.json", **(environment or {}))
    forger.write(path)
    return path


def totals(said):
    (board,) = said.json["boards"]
    return {total["estimator"]: total for total in board["totals"]}


def test_the_published_board_is_that_of_the_run_with_its_source_and_date(boards, vobench, ran, published):
    said = boards()
    assert said.code == 0, said.err
    assert said.out.startswith("tiny")
    assert "stand_still, wheel_odometry: results/tiny/builtin.zip" in said.out
    (board,) = boards("--json").json["boards"]
    reported = vobench("report", ran, "--json").json
    assert board["cells"] == reported["cells"]
    assert board["sources"][0]["environment"]["date"] == reported["environment"]["date"]
    assert board["sources"][0]["environment"]["processors"]


def test_the_run_of_a_user_is_ranked_among_the_published_ones(boards, published, here):
    mine = with_only(published, here / "mine.zip", "wheel_odometry")
    found = totals(boards("--with", mine, "--json"))
    assert sorted(found) == ["mine", "stand_still", "wheel_odometry"]
    assert found["mine"]["score"] == found["wheel_odometry"]["score"]
    assert "mine: mine.zip" in boards("--with", mine).out


def test_a_run_of_the_same_estimators_is_no_repeat_of_the_published_ones(boards, published, ran):
    found = totals(boards("--with", ran, "--json"))
    assert sorted(found) == [
        "stand_still",
        "stand_still of tiny",
        "wheel_odometry",
        "wheel_odometry of tiny",
    ]
    assert {total["trials"] for total in found.values()} == {1}


def test_times_of_another_processor_are_shown_and_not_ranked(boards, published, here):
    mine = with_only(published, here / "mine.zip", "wheel_odometry", environment=OTHER_PROCESSOR)
    assert not any(total["machine"] for total in totals(boards("--json")).values())
    found = totals(boards("--with", mine, "--json"))
    assert {name: total["machine"] for name, total in found.items()} == {
        "mine": "B",
        "stand_still": "A",
        "wheel_odometry": "A",
    }
    assert not any(total["is_efficient"] for total in found.values())
    said = boards("--with", mine)
    assert "(B)" in said.out
    assert "Times of different processors, or taken in different ways, are not compared" in said.out
    assert "Another processor (x86-64-v2)" in said.out


def test_other_cases_are_on_a_board_of_their_own_that_says_why(boards, published, here):
    mine = with_only(published, here / "mine.zip", "wheel_odometry")
    forger = forger_of(mine)
    camera = json.loads(forger.files["cases/short/case.json"])["camera"]
    forger.edit("cases/short/case.json", camera=camera | {"gain_db": 3.0})
    forger.write(mine)
    said = boards("--with", mine)
    assert said.code == 0, said.err
    assert (
        "mine.zip is not compared with results/tiny/builtin.zip: its short is another case, of other settings: camera"
        in said.out
    )
    first, second = boards("--with", mine, "--json").json["boards"]
    assert [total["estimator"] for total in second["totals"]] == ["mine"]
    assert "mine" not in {total["estimator"] for total in first["totals"]}


def changed_estimate(forger):
    forger.files[f"{TRIAL}/estimate.tum"] = forger.files["cases/short/estimates/wheel_odometry/0/estimate.tum"]


def changed_estimate_with_old_hash(forger):
    changed_estimate(forger)
    forger.hashes_fit = False


def changed_score(forger):
    score = json.loads(forger.files[f"{TRIAL}/score.json"])["score"]
    metrics = [metric | {"rmse": 1e-9, "mean": 1e-9} for metric in score["metrics"]]
    forger.edit(f"{TRIAL}/score.json", score=score | {"metrics": metrics})


def changed_truth(forger):
    forger.files[TRUTH] = forger.files[f"{TRIAL}/estimate.tum"]


def other_suite(forger):
    forger.edit("suite.json", name="giant")


@pytest.mark.parametrize(
    ("forge", "sentence"),
    [
        (changed_estimate, "stand_still on short, 0: another score than its run states"),
        (changed_estimate_with_old_hash, f"{TRIAL}/estimate.tum is not the file that was bundled"),
        (changed_score, "stand_still on short, 0: another score than its run states"),
        (changed_truth, "short: its ground_truth.tum is not the path that its case.json gives"),
        (other_suite, "is of the suite 'giant', not 'tiny'"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_a_forged_submission_is_refused_in_one_sentence_and_the_others_stay(boards, published, here, forge, sentence):
    honest = totals(boards("--json"))
    forger = forger_of(published)
    forge(forger)
    forger.write(published.with_name("forged.zip"))
    said = boards()
    assert said.code == 1
    (line,) = said.err.splitlines()
    assert line.startswith(f"vobench: refused: {sentence}")
    assert line.endswith("results/tiny/forged.zip")
    again = boards("--json")
    assert totals(again) == honest
    assert len(again.json["refused"]) == 1


def test_a_truth_that_is_submitted_as_an_estimate_is_no_valid_score_and_has_no_rank(boards, vobench, published, here):
    forger = forger_of(published)
    forger.files[f"{TRIAL}/estimate.tum"] = forger.files[TRUTH]
    copied = here / "copied.zip"
    forger.write(copied)
    said = boards("--with", copied)
    assert (said.code, "another score than its run states" in said.err) == (1, True)


def test_a_suite_that_has_changed_since_is_named(boards, published, here):
    assert boards("--json").json["boards"][0]["outdated"] == ""
    suite = here / "suites" / "tiny.yaml"
    suite.write_text(suite.read_text() + "cameras: {loud: {gain_db: 6}}\n")
    said = boards()
    assert said.code == 0, said.err
    assert "The suite tiny is not that of results/tiny/builtin.zip: its short is another case" in said.out


def test_one_suite_is_shown_by_its_name_and_an_unknown_one_is_a_sentence(boards, published, here):
    shutil.copytree(published.parent, here / "results" / "wide")
    assert boards("tiny").code == 0
    assert boards("tiny").out.count("results/tiny/builtin.zip") == 1
    said = boards("tinny")
    assert said.code == 1
    assert "Did you mean 'tiny'" in said.err


def test_a_run_of_another_suite_than_the_named_one_is_refused(boards, published, here):
    forger = forger_of(published)
    other_suite(forger)
    forger.write(here / "giant.zip")
    said = boards("tiny", "--with", here / "giant.zip")
    assert said.code == 1
    assert "is of the suite 'giant', not 'tiny'" in said.err
    alone = boards("--with", here / "giant.zip", "--json")
    assert [board["suite"] for board in alone.json["boards"]] == ["tiny", "giant"]


def test_markdown_has_all_boards_and_other_formats_one(boards, published, here):
    mine = with_only(published, here / "mine.zip", "wheel_odometry", environment={"vobench": "9.9"})
    text = boards("--with", mine, "--format", "md").out
    assert text.count("# tiny\n") == 2
    assert "it was made by vobench 9.9" in text
    assert "html has one board, and these are 2" in boards("--with", mine, "--format", "html").err
    assert boards("--out", "board.html").code == 0
    page = (here / "board.html").read_text()
    assert "results/tiny/builtin.zip" in page
    assert "estimate.tum" not in page  # the bundle was only unpacked for a while


def test_without_a_folder_of_results_there_is_a_sentence(vobench, here):
    said = vobench("leaderboard", "--results", "nowhere")
    assert said.code == 1
    assert "no such folder of results: nowhere" in said.err
