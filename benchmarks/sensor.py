"""What the sensor chain costs: each effect alone on the clean chip, and whole cameras.

    python benchmarks/sensor.py [--pictures 30]

Times are medians per picture of 720 × 480, in milliseconds of CPU time on one thread.
"""

import argparse
import os
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from vobench.geometry.rig import LENSES
from vobench.sensor.exposure import AutoExposure, Exposure, initial_exposures, next_exposures
from vobench.sensor.image_sensor import (
    CAMERAS,
    CameraSensor,
    CameraSettings,
    NoiseStreams,
    Radiance,
    expose,
    fixed_pattern,
)
from vobench.sensor.lens import apply_lens, lens_maps
from vobench.sensor.rolling_shutter import row_strips

LENS = LENSES["paper_literal"]
SHAPE = (LENS.height_px, LENS.width_px)
CLEAN = CAMERAS["clean"]
CHIP_EFFECTS: dict[str, CameraSensor] = {
    "clean chip: rounding after the sRGB curve": CLEAN,
    "  with a linear response": replace(CLEAN, response="linear"),
    "  with gamma 2.2": replace(CLEAN, response=2.2),
    "  with a converter of 10 bits": replace(CLEAN, adc_bits=10),
    "  with shot noise": replace(CLEAN, shot_noise=True),
    "  with shot noise, under 10 electrons everywhere": replace(CLEAN, shot_noise=True, full_well_e=8.0),
    "  with read noise": replace(CLEAN, read_noise_e=25.0),
    "  with PRNU, DSNU, columns, hot pixels": replace(CLEAN, prnu=0.01, dsnu_e=10.0, column_e=2.0, hot_share=1e-3),
}
LENS_EFFECTS: dict[str, CameraSettings] = {
    "vignetting": CameraSettings(vignetting=1.0),
    "blur, any width": CameraSettings(blur_sigma_px=1.0),
    "defocus, any width": CameraSettings(defocus_px=6.0),
    "dirt": CameraSettings(dirt=0.05),
    "all four": CameraSettings(vignetting=1.0, blur_sigma_px=1.0, defocus_px=6.0, dirt=0.05),
}


def median_ms(work: Callable[[], object], repeats: int) -> float:
    """The median cost of a call; the first one warms up and does not count."""
    spent = []
    for _ in range(repeats + 1):
        started = time.thread_time()
        work()
        spent.append(time.thread_time() - started)
    return float(1e3 * np.median(spent[1:]))


def picture() -> Radiance:
    """Light as rooms have it: mostly a fifth of white, some of it beyond."""
    return np.exp(np.random.default_rng(0).normal(-1.6, 0.8, SHAPE)).astype(np.float32)


def noise() -> NoiseStreams:
    """Generators for a picture's noise."""
    return NoiseStreams(*np.random.default_rng(1).spawn(2))


def chips(sensors: dict[str, CameraSensor]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Exposing a picture on each of the chips."""
    light = picture()
    streams = noise()
    for name, sensor in sensors.items():
        pattern = fixed_pattern(SHAPE, sensor, np.random.default_rng(2))
        camera = CameraSettings(chip=sensor)
        yield name, lambda camera=camera, pattern=pattern: expose(light, camera, streams, pattern=pattern)


def lenses() -> Iterator[tuple[str, Callable[[], object]]]:
    """Sending a picture through each lens."""
    light = picture()
    for name, effects in LENS_EFFECTS.items():
        maps = lens_maps(effects, LENS, np.random.default_rng(3))
        yield name, lambda maps=maps: apply_lens(light, maps)


def the_rest() -> Iterator[tuple[str, Callable[[], object]]]:
    """What else happens per picture, and what happens once per camera."""
    loop = AutoExposure()
    chip = CAMERAS["mt9v034"]
    grey = expose(picture(), CameraSettings(), noise())
    signal = chip.signal_of_grey
    state = initial_exposures(loop, Exposure(0.005))
    yield "auto-exposure, a step", lambda: next_exposures(loop, state, grey, signal)
    yield (
        "32 strips of 8 sub-frames",
        lambda: row_strips(SHAPE[0], readout_s=0.02, t_ns=0, exposure_s=0.01, strip_count=32, sub_frames=8),
    )
    yield "once: a fixed pattern", lambda: fixed_pattern(SHAPE, chip, np.random.default_rng(2))
    yield (
        "once: a lens with all four effects",
        lambda: lens_maps(LENS_EFFECTS["all four"], LENS, np.random.default_rng(3)),
    )


def main() -> None:
    """Measure everything, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=int, default=30, help="images per measurement")
    repeats = parser.parse_args().pictures
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    whole = {f"chip {name}": sensor for name, sensor in CAMERAS.items()}
    for heading, rows in (
        ("chip", chips(CHIP_EFFECTS)),
        ("lens", lenses()),
        ("all effects of a chip", chips(whole)),
        ("the rest", the_rest()),
    ):
        print(f"\n{heading}")
        for name, work in rows:
            print(f"  {name:50}{median_ms(work, repeats):8.2f} ms")


if __name__ == "__main__":
    main()
