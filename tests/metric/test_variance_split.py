"""The variance of trials is split among factors as it was put together, and no factor gets what noise gives."""

from itertools import product

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.metric.variance_split import REST, Factor, variance_split

SIZES = {"estimator": 4, "scenario": 5, "place": 8, "drive": 2}
TRIALS = list(product(*map(range, SIZES.values())))  # (estimator, scenario, place, drive)
DRIVE = 3


def factors(trials=TRIALS):
    """The factors of trials; drives are nested in their places."""
    return [
        Factor("estimator", [trial[0] for trial in trials]),
        Factor("scenario", [trial[1] for trial in trials]),
        Factor("place", [trial[2] for trial in trials]),
        Factor("drive", [trial[2:] for trial in trials], within=("place",)),
    ]


def drawn(rng, trials=TRIALS, **sigmas):
    """Values with normal effects of each factor, and noise, with standard deviations."""
    values = rng.normal(0, sigmas.get(REST, 0.0), len(trials))
    for factor in factors(trials):
        effects = {level: rng.normal(0, sigmas.get(factor.name, 0.0)) for level in sorted(set(factor.levels))}
        values += np.array([effects[level] for level in factor.levels])
    return values


@pytest.mark.parametrize("name", ["estimator", "scenario", "place", "drive"])
def test_an_effect_of_one_factor_alone_is_all_of_the_variance(name):
    values = drawn(np.random.default_rng(1), **{name: 1.0})
    shares = variance_split(values, factors())
    assert shares[name] == pytest.approx(1, abs=0.35 if name == "drive" else 1e-9)
    assert sum(shares.values()) == pytest.approx(1)


def test_noise_alone_is_the_rest_however_many_levels_a_factor_has():
    shares = [variance_split(drawn(np.random.default_rng(seed), rest=1.0), factors()) for seed in range(20)]
    assert np.mean([share[REST] for share in shares]) > 0.95
    assert max(np.mean([share[name] for share in shares]) for name in SIZES) < 0.02


def test_known_variances_are_found_on_average():
    sigmas = {"estimator": 1.0, "scenario": 0.5, "place": 0.8, "drive": 0.6, REST: 0.7}
    found = []
    for seed in range(80):
        shares = variance_split(drawn(np.random.default_rng(seed), **sigmas), factors())
        found.append([shares[name] / shares[REST] * sigmas[REST] ** 2 for name in SIZES])
    # A finite number of levels has (L - 1) / L of the variance that its effects are drawn with.
    shrunk = [1.0 * 3 / 4, 0.25 * 4 / 5, 0.64 * 7 / 8, 0.36 / 2]
    assert np.mean(found, axis=0) == pytest.approx(shrunk, rel=0.25)


def test_drives_are_not_taken_for_places():
    shares = [variance_split(drawn(np.random.default_rng(seed), drive=1.0, rest=0.3), factors()) for seed in range(40)]
    # Without a correction for drives, places would have almost half. Negative estimates are cut off, so some is left.
    assert np.median([share["place"] for share in shares]) < 0.15
    assert np.mean([share["place"] for share in shares]) < 0.3
    assert np.mean([share["drive"] for share in shares]) > 0.6


def test_an_interaction_does_not_take_the_effects_of_its_factors():
    rng = np.random.default_rng(4)
    values = drawn(rng, estimator=1.0, place=0.5, rest=0.1)
    interaction = Factor("estimator x place", [trial[:1] + trial[2:3] for trial in TRIALS], ("estimator", "place"))
    alone = variance_split(values, factors())
    shares = variance_split(values, [*factors(), interaction])
    for name, share in alone.items():
        assert shares[name] == pytest.approx(share, abs=0.01)
    assert shares["estimator x place"] < 0.01


def test_shares_do_not_depend_on_unit_offset_and_order_of_trials():
    rng = np.random.default_rng(3)
    values = drawn(rng, estimator=1.0, place=0.5, drive=0.3, rest=0.4)
    shares = variance_split(values, factors())
    order = rng.permutation(len(TRIALS))
    shuffled = variance_split((7 + 3 * values)[order], factors([TRIALS[index] for index in order]))
    for name, share in shares.items():
        assert shuffled[name] == pytest.approx(share, abs=1e-9)


def test_an_unbalanced_design_does_not_give_one_factor_what_another_explains():
    trials = [trial for trial in TRIALS if (trial[1] + trial[2]) % 3]  # each scenario in some of the places
    values = drawn(np.random.default_rng(5), trials, place=1.0, rest=1e-6)
    shares = variance_split(values, factors(trials))
    assert shares["place"] == pytest.approx(1, abs=1e-6)
    assert shares["scenario"] < 1e-6


def test_a_factor_with_one_level_explains_nothing():
    values = np.random.default_rng(2).normal(size=12)
    shares = variance_split(values, [Factor("estimator", ["lk"] * 12), Factor("place", [0, 1, 2, 3] * 3)])
    assert shares["estimator"] == 0


def test_too_few_and_equal_values_are_refused():
    with pytest.raises(InputError, match="3 values are too few to tell 1 factors from noise"):
        variance_split(np.array([1.0, 2.0, 3.0]), [Factor("place", [0, 1, 2])])
    with pytest.raises(InputError, match="all values are equal"):
        variance_split(np.zeros(12), [Factor("place", [0, 1, 2, 3] * 3)])
