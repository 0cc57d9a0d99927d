"""Statistics of images that were made with known ones."""

import numpy as np
import pytest

from tests.analysis.test_image_noise import as_grey, boards
from vobench.analysis.image_statistics import (
    TILE_PX,
    corners,
    edge_px,
    evenly_spaced,
    gradients,
    picture_statistics,
    spectrum,
    track_statistics,
)


def ramp(dx: float, dy: float) -> np.ndarray:
    row, column = np.mgrid[0:60, 0:80]
    return as_grey(128 + dx * (column - 40) + dy * (row - 30))


def test_items_are_chosen_evenly_from_the_first_to_the_last() -> None:
    assert evenly_spaced(list(range(23)), 12) == list(range(0, 23, 2))
    assert len(evenly_spaced([1, 2, 3], 12)) == 12


# --- Gradients and edges ---


@pytest.mark.parametrize(("dx", "dy"), [(2, 0), (0, 2), (-2, 0), (1, 1), (1, -2)])
def test_the_gradient_of_a_ramp_is_its_slope_in_any_direction(dx: float, dy: float) -> None:
    inner = gradients(ramp(dx, dy))[1:-1, 1:-1]
    np.testing.assert_allclose(inner, np.hypot(dx, dy), rtol=1e-6)
    assert picture_statistics(ramp(dx, dy))["gradient_p99"] == pytest.approx(np.hypot(dx, dy))


def test_the_gradients_percentile_is_that_which_one_pixel_in_a_hundred_exceeds() -> None:
    picture = np.full((100, 400), 100, np.uint8)
    picture[:, 200:] = 140  # a step has half its height as gradient in the two columns beside it: 0.5 % of them
    assert picture_statistics(picture)["gradient_p99"] == 0
    assert picture_statistics(picture[:, 130:270])["gradient_p99"] == 20  # 1.4 %


@pytest.mark.parametrize("columns", [2, 20, 50])
def test_the_kurtosis_of_gradients_of_two_values_follows_from_their_shares(columns: int) -> None:
    steps = np.zeros(100)
    steps[1 : 1 + columns] = 2.0
    picture = as_grey(20 + np.tile(np.cumsum(steps), (50, 1)))
    gradient = gradients(picture)
    share = np.sort(gradient[25])[::-1].sum() / 2 / 100  # columns with half the slope are at both ends
    expected = (1 - 3 * share * (1 - share)) / (share * (1 - share))
    assert picture_statistics(picture)["gradient_kurtosis"] == pytest.approx(expected, rel=0.2 + 2 / columns**2)


def test_a_flat_image_has_no_kurtosis_and_no_edges() -> None:
    found = picture_statistics(np.full((60, 80), 90, np.uint8))
    for name in ("gradient_p99", "gradient_kurtosis", "edge_px", "corners", "grey_sd"):
        assert found[name] == 0, name


def test_more_blur_makes_edges_wider() -> None:
    widths = [edge_px(as_grey(boards(sigma_px=s)), gradients(as_grey(boards(sigma_px=s)))) for s in (0.6, 0.9, 1.3)]
    assert widths == sorted(widths)
    assert widths[2] > 1.4 * widths[0]


@pytest.mark.parametrize("width", [2, 4])
def test_an_edge_is_as_wide_as_its_ramp_whatever_its_height(width: int) -> None:
    for height in (40, 120):
        row = np.clip((np.arange(80) - 40) / width, 0, 1) * height + 60
        picture = as_grey(np.tile(row, (60, 1)))
        assert edge_px(picture, gradients(picture)) == pytest.approx(width, rel=0.01 if width > 2 else 0.35)


def test_edges_to_black_or_saturated_parts_do_not_count() -> None:
    for low, high, is_counted in ((3, 253, True), (2, 253, False), (3, 254, False)):
        picture = np.full((60, 80), low, np.uint8)
        picture[:, 40:] = high
        assert (edge_px(picture, gradients(picture)) > 0) == is_counted


def test_weaker_gradients_than_one_grey_value_a_pixel_are_no_edges() -> None:
    weak = as_grey(100 + np.tile(np.arange(80) // 3, (60, 1)))
    assert gradients(weak).max() < 1
    assert edge_px(weak, gradients(weak)) == 0


# --- Corners ---


def squares(*corner_px: tuple[int, int]) -> np.ndarray:
    picture = np.full((240, 320), 60, np.uint8)
    for x, y in corner_px:
        picture[y : y + 12, x : x + 12] = 200
    return picture


def test_the_corners_of_a_square_are_found() -> None:
    found = corners(squares((100, 60)))
    assert found.shape == (4, 2)
    nearest = {tuple(np.rint((point - (105.5, 65.5)) / 6).astype(int).tolist()) for point in found}
    assert nearest == {(-1, -1), (-1, 1), (1, -1), (1, 1)}
    assert corners(np.full((40, 40), 7, np.uint8)).shape == (0, 2)


def test_corners_in_one_of_48_cells_are_as_uneven_as_can_be_and_one_square_in_each_are_even() -> None:
    one_cell = picture_statistics(squares((14, 14)))
    assert one_cell["corners"] == 4
    assert one_cell["corner_unevenness"] == pytest.approx(np.sqrt(47))
    two_cells = picture_statistics(squares((14, 14), (294, 214)))
    assert two_cells["corner_unevenness"] == pytest.approx(np.sqrt(23))
    everywhere = picture_statistics(squares(*((x, y) for x in range(14, 320, 40) for y in range(14, 240, 40))))
    assert everywhere["corners"] == 4 * 48
    assert everywhere["corner_unevenness"] == 0


# --- Grey values ---


def test_the_deviation_and_the_mean_of_grey_are_those_of_two_values() -> None:
    picture = np.full((60, 80), 100, np.uint8)
    picture[:, 40:] = 140
    found = picture_statistics(picture)
    assert found["grey_sd"] == pytest.approx(20)
    assert found["grey_mean"] == pytest.approx(120)


@pytest.mark.parametrize(("level", "burnt"), [(255, 25.0), (254, 25.0), (253, 0.0)])
def test_burnt_are_the_percent_of_pixels_at_254_or_more(level: int, burnt: float) -> None:
    picture = np.full((60, 80), 100, np.uint8)
    picture[:, :20] = level
    assert picture_statistics(picture)["burnt"] == burnt


# --- Power spectrum ---


def power_law(exponent: float, *, size: int = 512) -> np.ndarray:
    """An image whose power falls with frequency by an exponent."""
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    frequency[0, 0] = np.inf
    white = np.fft.fft2(np.random.default_rng(2).standard_normal((size, size)))
    picture = np.fft.ifft2(white * frequency ** (exponent / 2)).real
    return picture / picture.std()


@pytest.mark.parametrize("exponent", [-2.0, -2.8])
def test_a_power_law_has_its_slope_whatever_its_contrast(exponent: float) -> None:
    for amplitude in (20, 40):
        slope, _ = spectrum([as_grey(128 + amplitude * power_law(exponent))])
        assert slope == pytest.approx(exponent, abs=0.1)


def test_twice_the_contrast_is_four_times_the_power_and_a_mean_of_images_is_one_of_power() -> None:
    weak, strong = (power_law(-2.0) * amplitude for amplitude in (20, 40))
    (_, of_weak), (_, of_strong), (_, of_both) = (
        spectrum([(128 + picture).astype(np.float32) for picture in pictures])
        for pictures in ([weak], [strong], [weak, strong])
    )
    np.testing.assert_allclose(of_strong - of_weak, np.log10(4), atol=1e-6)
    np.testing.assert_allclose(of_both - of_weak, np.log10(2.5), atol=1e-6)


@pytest.mark.parametrize("cycles", [8, 40])
@pytest.mark.parametrize("axis", [0, 1])
def test_a_wave_has_its_power_at_its_number_of_cycles_a_tile(cycles: int, axis: int) -> None:
    phase = 2 * np.pi * cycles * np.arange(300) / TILE_PX
    wave = 100 + 50 * np.sin(phase)
    picture = np.tile(wave, (300, 1)) if axis else np.tile(wave[:, None], (1, 300))
    _, log_power = spectrum([as_grey(picture)])
    assert len(log_power) == TILE_PX // 2
    assert int(np.argmax(log_power)) == cycles


def test_all_of_an_image_is_seen_and_a_small_one_is_continued_by_reflection() -> None:
    plain = np.full((400, 700), 100, np.uint8)
    assert spectrum([plain])[1].max() < -6
    for corner in (np.s_[:60, :60], np.s_[:60, -60:], np.s_[-60:, :60], np.s_[-60:, -60:]):
        picture = plain.copy()
        picture[corner] = 100 + as_grey(20 * np.abs(power_law(-1.0, size=60)))
        assert spectrum([picture])[1].max() > 0
    half = as_grey(128 + 30 * power_law(-2.0, size=TILE_PX))[: TILE_PX // 2]
    np.testing.assert_allclose(spectrum([half])[1], spectrum([np.vstack([half, half[::-1]])])[1])


# --- Tracks ---


def texture(seed: int = 0) -> np.ndarray:
    return (
        as_grey(128 + 40 * power_law(-1.6, size=256))
        if seed == 0
        else as_grey(128 + 40 * np.roll(power_law(-1.6, size=256), (97 * seed, 61 * seed), (0, 1))[::-1])
    )


def test_tracks_of_a_still_image_are_all_consistent_and_none_ends() -> None:
    found = track_statistics([texture()] * 5)
    assert found.consistent_share == 1
    assert found.flow_px == pytest.approx(0, abs=0.01)
    assert found.alive_share.tolist() == [1.0] * 5


@pytest.mark.parametrize("shift", [(0, 2), (3, 0), (-3, 4)])
def test_flow_is_the_length_of_the_shift(shift: tuple[int, int]) -> None:
    images = [np.roll(texture(), (nth * shift[0], nth * shift[1]), (0, 1)) for nth in range(3)]
    found = track_statistics(images)
    assert found.flow_px == pytest.approx(np.hypot(*shift), abs=0.05)
    assert found.consistent_share > 0.9


def test_tracks_end_where_the_image_becomes_flat_and_half_of_them_in_half_an_image() -> None:
    flat = np.full((256, 256), 128, np.uint8)
    found = track_statistics([texture(), texture(), flat, flat])
    assert found.alive_share[:2].tolist() == [1, 1]
    assert found.alive_share[2:].max() < 0.05
    # From textured to textured, from textured to flat, and from flat, which has no corners.
    assert found.consistent_share == pytest.approx(1 / 3, abs=0.03)
    half = texture().copy()
    half[:, 128:] = 128
    assert track_statistics([texture(), half]).consistent_share == pytest.approx(0.5, abs=0.07)


def test_tracks_that_leave_the_image_end() -> None:
    images = [np.roll(texture(), 8 * nth, 1) for nth in range(4)]
    for nth, image in enumerate(images):
        image[:, : 8 * nth] = 128  # nothing comes in from the other side
    alive = track_statistics(images).alive_share
    assert (np.diff(alive) < 0).all()
    assert alive[3] == pytest.approx(1 - 24 / 256, abs=0.06)


def test_a_single_image_has_no_tracks_to_judge() -> None:
    found = track_statistics([texture()])
    assert (found.consistent_share, found.flow_px, found.alive_share.tolist()) == (0, 0, [1.0])


def test_of_images_without_corners_nothing_is_tracked() -> None:
    flat = np.full((64, 64), 128, np.uint8)
    found = track_statistics([flat, flat])
    assert (found.consistent_share, found.flow_px, found.alive_share.tolist()) == (0, 0, [1.0, 0.0])


@pytest.mark.parametrize("size", [(256, 256), (256, 512), (512, 256)])
def test_whole_tiles_are_taken_without_overlap(size: tuple[int, int]) -> None:
    picture = as_grey(128 + 30 * power_law(-2.0))[: size[0], : size[1]]
    window = np.outer(np.hanning(TILE_PX), np.hanning(TILE_PX))
    powers = []
    for row in range(0, size[0], TILE_PX):
        for column in range(0, size[1], TILE_PX):
            tile = picture[row : row + TILE_PX, column : column + TILE_PX].astype(float)
            powers.append(np.abs(np.fft.fft2((tile - tile.mean()) * window)) ** 2)
    x, y = np.meshgrid(np.fft.fftfreq(TILE_PX, 1 / TILE_PX), np.fft.fftfreq(TILE_PX, 1 / TILE_PX))
    rings = np.rint(np.hypot(x, y))
    _, log_power = spectrum([picture])
    for cycles in (1, 4, 30, 100):
        assert 10 ** log_power[cycles] == pytest.approx(np.mean([power[rings == cycles].mean() for power in powers]))
