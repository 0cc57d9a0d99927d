"""Pixels of textures: painted when they are needed, kept up to a number of bytes, and painted again after that."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from vobench.asset.kept_pixels import KeptPixels, Pixels


@pytest.fixture
def painted() -> Counter[str]:
    """How often each picture was painted."""
    return Counter()


def picture(kept: KeptPixels, painted: Counter[str], name: str, size: int) -> Callable[[], Pixels]:
    """A picture of `size` bytes, which counts its paintings."""

    def paint() -> Pixels:
        painted[name] += 1
        return np.full(size, len(name), np.uint8)

    return kept.lazy(paint)


def test_a_picture_is_painted_when_it_is_needed_and_then_kept(painted: Counter[str]) -> None:
    pixels = picture(KeptPixels(100), painted, "wood", 60)
    assert not painted
    assert pixels() is pixels()
    assert painted == {"wood": 1}


def test_the_picture_that_was_not_needed_for_longest_is_painted_again(painted: Counter[str]) -> None:
    kept = KeptPixels(100)
    wood, cloth, stone = (picture(kept, painted, name, 40) for name in ("wood", "cloth", "stone"))
    wood()
    cloth()
    wood()
    stone()  # 120 bytes: cloth was not needed for longest
    wood()
    assert painted == {"wood": 1, "cloth": 1, "stone": 1}
    assert (cloth() == 5).all()
    assert painted["cloth"] == 2


def test_a_picture_above_the_limit_is_kept_until_the_next_one(painted: Counter[str]) -> None:
    kept = KeptPixels(100)
    large = picture(kept, painted, "large", 500)
    assert large() is large()
    picture(kept, painted, "small", 10)()
    large()
    assert painted == {"large": 2, "small": 1}
