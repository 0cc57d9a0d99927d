"""Racks carry decks at their levels."""

import numpy as np
import pytest

from vobench.asset.furniture import matt
from vobench.asset.pallet_rack import Rack


def test_a_rack_has_a_deck_at_each_level_and_uprights_between_its_bays() -> None:
    rack = Rack(3, 2.7, 1.1, (1.5, 3.0), matt("#24427a"), matt("#d8641e"))
    uprights, beams, decks = rack.parts()
    assert np.ptp(uprights.arrays.vertices_m[:, 0]) == pytest.approx(rack.length_m, abs=0.05)
    tops_m = np.unique(decks.arrays.vertices_m[:, 2].round(3))
    assert {1.499, 2.999} <= set(tops_m.tolist())
    assert beams.arrays.vertices_m[:, 2].max() == pytest.approx(3.0)
    assert rack.bay_x_m(1) == pytest.approx(0)


def test_bays_are_a_pitch_apart_and_centred() -> None:
    rack = Rack(4, 2.7, 1.1, (1.5,), matt(), matt())
    middles_m = [rack.bay_x_m(bay) for bay in range(4)]
    np.testing.assert_allclose(np.diff(middles_m), rack.pitch_m)
    assert sum(middles_m) == pytest.approx(0)
