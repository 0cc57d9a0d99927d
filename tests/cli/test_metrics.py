"""vobench metrics defines one metric, or lists all."""


def test_one_metric_is_printed_with_a_line_for_each_of_its_facts(vobench):
    facts = vobench("metrics", "ate_trans", "--json").json
    lines = vobench("metrics", "ate_trans").out.splitlines()
    assert len(lines) == len(facts)
    for line, name in zip(lines, facts, strict=True):
        assert line.startswith(f"{name:9}  ")


def test_all_metrics_are_listed_with_the_option_that_those_beyond_the_headlines_need(vobench):
    metrics = vobench("metrics", "--json").json["metrics"]
    printed = vobench("metrics").out
    assert {"ate_trans", "rpe_trans"} <= {metric["id"] for metric in metrics}
    assert all(metric["id"] in printed for metric in metrics)
    assert "--full" in printed


def test_a_metric_that_is_unknown_is_one_line(vobench):
    said = vobench("metrics", "ate_tran")
    assert (said.code, said.out) == (1, "")
    assert "Did you mean 'ate_trans'?" in said.err
