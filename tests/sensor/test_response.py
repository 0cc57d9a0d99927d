"""Responses invert exactly, and the look-up table rounds as the curve itself would."""

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.sensor.response import LINEAR, SRGB, Power, ResponseTable, linear_of_grey, quantise

MEASURED = ResponseTable(tuple(np.linspace(0, 1, 256) ** 1.8 + 0.3 * np.linspace(0, 1, 256)))
RESPONSES = {"linear": LINEAR, "srgb": SRGB, "gamma": Power(2.2), "steep": Power(6.0), "table": MEASURED}
every_response = pytest.mark.parametrize("response", RESPONSES.values(), ids=list(RESPONSES))


@every_response
def test_decoding_undoes_encoding(response) -> None:
    signal = np.linspace(0, 1, 1001)
    # The standard's two pieces of sRGB miss each other by some 1e-8 where they meet.
    np.testing.assert_allclose(response.decode(response.encode(signal)), signal, atol=1e-7)
    np.testing.assert_allclose(response.encode(response.decode(signal)), signal, atol=1e-7)


@every_response
def test_black_and_full_scale_stay(response) -> None:
    np.testing.assert_allclose(response.encode(np.array([0.0, 1.0])), [0, 1], atol=1e-12)


@every_response
def test_the_signal_of_a_grey_value_gives_that_grey_value(response) -> None:
    np.testing.assert_array_equal(quantise(linear_of_grey(response), response), np.arange(256))


@every_response
def test_the_table_rounds_as_the_curve_does(response) -> None:
    signal = np.random.default_rng(0).random((300, 1000)) ** 3
    np.testing.assert_array_equal(quantise(signal, response), np.floor(255 * response.encode(signal) + 0.5))


@every_response
def test_rounding_is_monotone_and_exact_at_the_borders(response) -> None:
    borders = response.decode((np.arange(255) + 0.5) / 255)
    np.testing.assert_array_equal(quantise(borders, response), np.arange(1, 256))
    np.testing.assert_array_equal(quantise(np.nextafter(borders, 0), response), np.arange(255))


def test_a_table_of_a_curve_is_that_curve() -> None:
    table, signal = ResponseTable(tuple(17.0 * linear_of_grey(SRGB))), np.linspace(0, 1, 500)
    np.testing.assert_allclose(table.encode(signal), SRGB.encode(signal), atol=1e-3)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((0.0,), "a tabulated response needs 2 or more values, got 1"),
        ((0.1, 1.0), "a tabulated response should begin with 0, the signal of black, got 0.1"),
        ((0.0, 2.0, 1.0), "a tabulated response should rise, but value 2 is 1.0 after 2.0"),
        ((0.0, float("nan")), "a tabulated response should rise, but value 1 is nan after 0.0"),
    ],
)
def test_a_table_that_cannot_be_inverted_is_refused(values: tuple[float, ...], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ResponseTable(values)


def test_a_gamma_that_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="and 10, got 0"):
        Power(0)
