"""What a camera does to light, in the files of TUM's monocular benchmark that DSO and its kin read.

camera.txt (lens), times.txt (number, s, exposure in ms), pcalib.txt (inverse response), vignette.png (16 bit).
Source: Engel, Usenko and Cremers (2016); the readme of DSO, "Geometric Calibration File".
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vobench.dataset import kalibr
from vobench.dataset.source import ExportSource, Views
from vobench.errors import InputError
from vobench.geometry.camera import BrownConrady, Camera, KannalaBrandt, Pinhole
from vobench.geometry.se3 import Array
from vobench.sensor.image_sensor import SENSOR_PRESETS
from vobench.sensor.lens import vignetting
from vobench.sensor.response import FULL_SCALE_DN, Response, linear_of_grey, response_of
from vobench.sequence.picture import write_png
from vobench.trajectory.formats import seconds
from vobench.trajectory.trajectory import Stamps

WHITE_16 = 65535
UNKNOWN = "Response and vignette of this camera are not known: there is no pcalib.txt and no vignette.png."
DSO_TERMS: dict[type, tuple[str, tuple[str, ...]]] = {
    BrownConrady: ("RadTan", kalibr.RADTAN_TERMS),
    KannalaBrandt: ("EquiDistant", KannalaBrandt.coefficients),
}


@dataclass(frozen=True, slots=True)
class Photometry:
    """What a simulated camera did to light, by its case."""

    response: Response
    black_dn: float
    vignetting: float
    cutoff_deg: float | None
    scattered: float
    readout_ms: float
    unlike: bool

    def remarks(self) -> list[str]:
        """Sentences on what the files have no place for."""
        found = [
            (self.black_dn, f"pcalib.txt leaves in the black level: {self.black_dn:g} grey values of linear signal."),
            (self.scattered, "What dirt and flare take and scatter is not in vignette.png."),
            (self.readout_ms, f"The shutter rolls, {self.readout_ms:g} ms a picture; stamps are the middle row's."),
            (self.unlike, "What sets one eye apart (unlike) is in neither pcalib.txt nor vignette.png."),
        ]
        return [sentence for amount, sentence in found if amount]


def photometry_of(case: Mapping[str, Any] | None) -> Photometry | None:
    """The camera of a case; None for a recording that has none, or one of another make."""
    try:
        camera = SENSOR_PRESETS.merged(_without_nothing((case or {})["camera"]))
        chip = camera["chip"]
        return Photometry(
            response=response_of(chip["response"]),
            black_dn=float(chip["black_dn"]),
            vignetting=float(camera.get("vignetting", 0.0)),
            cutoff_deg=camera.get("vignetting_cutoff_deg"),
            scattered=sum(float(camera.get(key, 0.0)) for key in ("dirt", "flare", "ghost")),
            readout_ms=float(camera.get("readout_ms", 0.0)),
            unlike=any(value not in (None, 1) for eye in camera.get("unlike", {}).values() for value in eye.values()),
        )
    except (InputError, KeyError, TypeError, ValueError, AttributeError):
        return None


def _without_nothing(section: Mapping[str, Any]) -> dict[str, Any]:
    """What is said: older cases say null of what they leave to the sensor that they name."""
    said = {key: value for key, value in section.items() if value is not None}
    return {**said, "chip": {key: value for key, value in said.get("chip", {}).items() if value is not None}}


def write_photometric(source: ExportSource, views: Views, stamps: Stamps, folder: Path) -> list[str]:
    """Fill `folder` with cam0 and cam1, and say what is not known; `stamps` are those of the exported frames."""
    photometry = photometry_of(source.case)
    times, notes = _times(source, stamps)
    notes += photometry.remarks() if photometry else [UNKNOWN]
    lenses = [camera_text(views.rig.camera(side)) for side in views.rig.sides]
    if None in lenses:
        notes.append("DSO has no model for such a lens, so there is no camera.txt.")
    for index, side in enumerate(views.rig.sides):
        cam = folder / f"cam{index}"
        cam.mkdir(parents=True)
        texts = {"times.txt": times, "camera.txt": lenses[index]}
        if photometry:
            signals_dn = linear_of_grey(photometry.response) * FULL_SCALE_DN  # of all grey values, from 0 to 255
            texts["pcalib.txt"] = " ".join(map(repr, signals_dn.tolist())) + "\n"
            shade = passed(views.rays_of(side, source.true_rig.camera(side)), photometry)
            write_png(cam / "vignette.png", np.rint(shade / shade.max() * WHITE_16).astype(np.uint16))
        for name, text in texts.items():
            if text:
                (cam / name).write_text(text, encoding="utf-8")
    return notes


def passed(rays: Array, photometry: Photometry) -> Array:
    """Share of light (H, W) along rays (H, W, 3) that the lens lets pass."""
    if not photometry.vignetting and photometry.cutoff_deg is None:
        return np.ones(rays.shape[:2])
    return vignetting(rays, strength=photometry.vignetting, cutoff_deg=photometry.cutoff_deg)


def camera_text(camera: Camera) -> str | None:
    """DSO's camera.txt, where the first pixel's centre is at 0.5, here at 0; None for a lens unknown to it."""
    width = camera.width_px
    height = camera.height_px
    (fx, _, cx), (_, fy, cy), _ = camera.K.tolist()
    relative = [fx / width, fy / height, (cx + 0.5) / width, (cy + 0.5) / height]
    if isinstance(camera, Pinhole):
        return _lines("Pinhole", [*relative, 0.0], "none", width, height)
    if type(camera) not in DSO_TERMS or (isinstance(camera, BrownConrady) and camera.k3):
        return None
    name, terms = DSO_TERMS[type(camera)]
    return _lines(name, [*relative, *(getattr(camera, term) for term in terms)], "crop", width, height)


def _lines(model: str, values: list[float], fit: str, width: int, height: int) -> str:
    return f"{model} {' '.join(map(repr, values))}\n{width} {height}\n{fit}\n{width} {height}\n"


def _times(source: ExportSource, stamps: Stamps) -> tuple[str, list[str]]:
    exposed_ns, settings = source.sequence.exposures()
    row_of = dict(zip(exposed_ns.tolist(), settings.tolist(), strict=True))
    found = [row_of.get(t) for t in stamps.tolist()]
    if any(row is None for row in found):
        text = "".join(f"{index:05d} {seconds(t)}\n" for index, t in enumerate(stamps.tolist()))
        return text, ["Exposures are not known of every picture, so times.txt has no third column."]
    time_s, gain_db = np.array(found, float).reshape(-1, 2).T
    notes = []
    if np.ptp(gain_db) > 0:
        time_s = time_s * 10 ** (gain_db / 20)
        notes.append("The gain changes, which times.txt has no column for: its exposures are multiplied by it.")
    elif gain_db[0]:
        notes.append(f"The gain, {gain_db[0]:g} dB throughout, is not in times.txt, which has no column for it.")
    rows = enumerate(zip(stamps.tolist(), (time_s * 1e3).tolist(), strict=True))
    return "".join(f"{index:05d} {seconds(t)} {ms!r}\n" for index, (t, ms) in rows), notes
