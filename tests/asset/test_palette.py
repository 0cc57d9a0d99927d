"""Palettes by seed: light ceilings, shared textures, and colours that differ between seeds."""

import numpy as np
import pytest

from vobench.asset import palette

MAKERS = [palette.home_style, palette.office_style]


@pytest.mark.parametrize("make", MAKERS)
def test_a_seed_gives_the_same_style_and_others_give_others(make) -> None:  # type: ignore[no-untyped-def]
    assert make(np.random.default_rng(4)) == make(np.random.default_rng(4))
    styles = [make(np.random.default_rng(seed)) for seed in range(40)]
    assert len({(style.plain.colour, style.planks, style.kitchen.fronts, style.cloths) for style in styles}) > 35


@pytest.mark.parametrize("make", MAKERS)
def test_plain_walls_and_ceilings_are_light(make) -> None:  # type: ignore[no-untyped-def]
    for seed in range(40):
        style = make(np.random.default_rng(seed))
        assert min(style.plain.colour) > 0.6
        assert min(style.ceiling.colour) > 0.6


def test_textures_are_shared_between_the_walls_of_a_flat() -> None:
    style = palette.home_style(np.random.default_rng(0))
    assert all(accent.texture is style.plain.texture for accent in style.accents)
