"""Scores of estimators on two cases, from the status and the error of each trial."""

from hypothesis import strategies as st

from vobench.runner.folder import NO_SEQUENCE, NOT_APPLICABLE, STATUSES, TrialScore

CASES = ("a", "b")
BEGUN = [status for status in STATUSES if status not in (NOT_APPLICABLE, NO_SEQUENCE)]
ates = st.none() | st.floats(0, 1e6)
trials = st.tuples(*[st.tuples(st.sampled_from(BEGUN), ates)] * len(CASES))
outcomes_of_four = st.fixed_dictionaries(dict.fromkeys(("p", "q", "r", "s"), trials))


def scores_of(outcomes):
    """The scores of trials given by (status, ATE in metres) for each estimator and case."""
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
