"""Pictures behind windows are dim, differ, and are painted once."""

import numpy as np

from vobench.asset.window_picture import HEIGHT_PX, PICTURES, WIDTH_PX, window_picture


def test_pictures_differ_and_are_darker_than_curtains_in_the_sun() -> None:
    pictures = [np.asarray(window_picture(number).pixels()) for number in range(PICTURES)]
    assert {pixels.shape for pixels in pictures} == {(HEIGHT_PX, WIDTH_PX, 3)}
    assert len({pixels.tobytes() for pixels in pictures}) == PICTURES
    assert max(float(pixels.mean()) for pixels in pictures) < 160


def test_half_curtains_cover_the_middle_of_the_window() -> None:
    middle = slice(WIDTH_PX // 2 - 4, WIDTH_PX // 2 + 4)
    open_window = np.asarray(window_picture(0).pixels())[:, middle]
    closed = np.asarray(window_picture(3).pixels())[:, middle]
    assert closed.mean() > open_window.mean() + 20
