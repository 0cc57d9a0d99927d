"""How long the fit of a twin's camera takes, and how near the fitted cameras are to the true ones.

    python benchmarks/twin_fit.py [--pictures 12] [--width 1241] [--height 376] [--only NAME ...]

The pictures are synthetic: textures with a 1/f amplitude spectrum and rectangles with sharp edges, of which each true
camera takes pictures with a noise of its own. Prints the CPU time of one fit, and true → fitted parameters.
"""

import argparse
import time

import numpy as np

from vobench.analysis.camera_fit import Lights, camera_of, fit_camera, look_of
from vobench.geometry.se3 import Array
from vobench.runner.store import SilentProgress
from vobench.sensor.image_sensor import CameraSettings, Radiance

# The true cameras: gain, gamma, blur in px, and noise relative to a chip of 20,000 electrons.
TRUE_CAMERAS = {
    "usual": (1.0, 0.45, 0.4, 1.0),
    "dark and noisy": (0.5, 0.6, 0.8, 3.0),
    "bright and flat": (1.6, 0.35, 1.5, 0.5),
    "steep": (1.2, 0.9, 0.6, 1.5),
}
MEDIAN_LIGHT = 0.25  # of diffuse white
CONTRAST = 0.7  # the standard deviation of the logarithm of the light of textures
RECTANGLES = 120
SEED_OF_RECORDING = 1000


def light_of_scene(shape: tuple[int, int], seed: int) -> Radiance:
    """Light (H, W) of a scene."""
    rng = np.random.default_rng(seed)
    height, width = shape
    logarithm = CONTRAST * _texture(shape, rng)
    for _ in range(RECTANGLES):
        row = rng.integers(0, height)
        column = rng.integers(0, width)
        rows = slice(row, row + rng.integers(5, height // 3))
        columns = slice(column, column + rng.integers(5, width // 8))
        logarithm[rows, columns] = 0.3 * logarithm[rows, columns] + rng.normal(0, 0.8)
    light: Radiance = (MEDIAN_LIGHT * np.exp(logarithm)).astype(np.float32)
    return light


def _texture(shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Noise (H, W) with an amplitude of 1 / frequency, and a standard deviation of 1."""
    rows = np.fft.fftfreq(shape[0])[:, None]
    columns = np.fft.fftfreq(shape[1])[None]
    frequency = np.hypot(rows, columns)
    frequency[0, 0] = np.inf
    spectrum = np.fft.fft2(rng.standard_normal(shape)) / frequency
    texture = np.fft.ifft2(spectrum).real
    scaled: Array = texture / texture.std()
    return scaled


def noise_of(settings: CameraSettings) -> float:
    """The noise of a chip relative to one of 20,000 electrons."""
    return float((20_000 / settings.chip.full_well_e) ** 0.5)


def main() -> None:
    """Fit every camera, and print the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=int, default=12)
    parser.add_argument("--width", type=int, default=1241)
    parser.add_argument("--height", type=int, default=376)
    parser.add_argument("--only", nargs="+", default=list(TRUE_CAMERAS), help="names of cameras")
    arguments = parser.parse_args()

    shape = (arguments.height, arguments.width)
    lights = [light_of_scene(shape, seed) for seed in range(arguments.pictures)]
    for name in arguments.only:
        gain, gamma, blur_px, noise = TRUE_CAMERAS[name]
        wanted = look_of(Lights(lights, seed=SEED_OF_RECORDING).develop(camera_of(gain, gamma, blur_px, noise)))
        began_s = time.process_time()
        settings, look = fit_camera(wanted, Lights(lights), progress=SilentProgress())
        spent_s = time.process_time() - began_s
        print(
            f"{name}: {spent_s:.1f} s of CPU; gain {gain:.3f} → {settings.exposure_gain:.3f}, "
            f"gamma {gamma:.3f} → {1 / float(str(settings.chip.response)):.3f}, "
            f"blur {blur_px:.2f} → {settings.blur_sigma_px:.2f} px, noise {noise:.2f} → {noise_of(settings):.2f}; "
            f"mean {wanted.mean_dn:.1f} → {look.mean_dn:.1f}, sd {wanted.sd_dn:.1f} → {look.sd_dn:.1f} DN, "
            f"edges {wanted.edge_px:.2f} → {look.edge_px:.2f} px, noise {wanted.noise_dn:.2f} → {look.noise_dn:.2f} DN",
            flush=True,
        )


if __name__ == "__main__":
    main()
