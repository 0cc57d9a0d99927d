"""Styles of houses differ by seed, and windows fit into their module."""

import numpy as np

from vobench.asset.front_style import front_style


def test_windows_are_narrower_than_their_module() -> None:
    for seed in range(20):
        style = front_style(np.random.default_rng(seed))
        assert style.window_m[0] + 0.9 <= style.module_m


def test_only_modern_houses_have_balconies_and_all_of_them_flat_roofs() -> None:
    styles = [front_style(np.random.default_rng(seed)) for seed in range(60)]
    assert all(style.is_modern for style in styles if style.has_balconies)
    assert {style.roof for style in styles if style.is_modern} == {"flat"}
    assert {style.roof for style in styles} == {"flat", "pitched"}
