"""Writes a photometric calibration in the format of TUM's monocular benchmark, which DSO and similar methods read.

The files are camera.txt (lens), times.txt (number, time in s, exposure in ms), pcalib.txt (inverse response) and
vignette.png (16 bit).
Source: Engel, Usenko and Cremers (2016); the readme of DSO, "Geometric Calibration File".
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.dataset import kalibr
from vobench.dataset.rectified_view import Views
from vobench.dataset.source import ExportSource
from vobench.errors import InputError
from vobench.geometry.camera import BrownConrady, Camera, KannalaBrandt, Pinhole, focal_and_center_px
from vobench.geometry.se3 import Array
from vobench.sensor.image_sensor import SENSOR_PRESETS
from vobench.sensor.lens import vignetting
from vobench.sensor.response import FULL_SCALE_DN, Response, linear_of_grey, response_of
from vobench.sequence.picture import write_png
from vobench.trajectory.stamp_text import format_seconds
from vobench.trajectory.trajectory import Stamps

WHITE_16 = 65535
MS_PER_S = 1e3
UNKNOWN = "Response and vignette of this camera are not known: there is no pcalib.txt and no vignette.png."


@dataclass(frozen=True, slots=True)
class Photometry:
    """The photometric properties of a simulated camera. `scattered` is the share of light lost to dirt and flare."""

    response: Response
    black_dn: float
    vignetting: float
    cutoff_deg: float | None
    scattered: float
    readout_ms: float
    cameras_differ: bool

    def remarks(self) -> list[str]:
        """Notes on the properties that the files cannot represent."""
        sentences = []
        if self.black_dn:
            sentences.append(f"pcalib.txt includes the black level: {self.black_dn:g} grey values of linear signal.")
        if self.scattered:
            sentences.append("The light that dirt and flare absorb and scatter is not in vignette.png.")
        if self.readout_ms:
            sentences.append(
                f"The shutter rolls, with {self.readout_ms:g} ms per image; stamps are those of the middle row."
            )
        if self.cameras_differ:
            sentences.append("The differences between the two cameras (unlike) are not in pcalib.txt or vignette.png.")
        return sentences


def photometry_of(case: Mapping[str, Any] | None) -> Photometry | None:
    """The photometric properties of the camera of a case; None without a case, or for a case of another kind."""
    try:
        settings = SENSOR_PRESETS.merged(_without_null((case or {})["camera"]))
        chip = settings["chip"]
        return Photometry(
            response=response_of(chip["response"]),
            black_dn=float(chip["black_dn"]),
            vignetting=float(settings.get("vignetting", 0.0)),
            cutoff_deg=settings.get("vignetting_cutoff_deg"),
            scattered=sum(float(settings.get(key, 0.0)) for key in ("dirt", "flare", "ghost")),
            readout_ms=float(settings.get("readout_ms", 0.0)),
            cameras_differ=_differ(settings.get("unlike", {})),
        )
    except (InputError, KeyError, TypeError, ValueError, AttributeError):
        return None


def _differ(unlike: Mapping[str, Mapping[str, Any]]) -> bool:
    """Whether any setting of a single camera has an effect. None and a gain of 1 have none."""
    values = [value for camera in unlike.values() for value in camera.values()]
    return any(value not in (None, 1) for value in values)


def _without_null(section: Mapping[str, Any]) -> dict[str, Any]:
    """The settings of a camera that are not null. Older cases have null for the value of the named sensor."""
    settings = _present(section)
    return {**settings, "chip": _present(settings.get("chip", {}))}


def _present(section: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in section.items() if value is not None}


def write_photometric(
    source: ExportSource,
    views: Views,
    stamps: Stamps,
    folder: Path,
) -> list[str]:
    """Write the folders cam0 and cam1, and return notes on what is unknown.

    `stamps` (N,) are the stamps of the exported frames.
    """
    photometry = photometry_of(source.case)
    times, notes = _times(source, stamps)
    notes += photometry.remarks() if photometry else [UNKNOWN]
    has_unknown_lens = False
    for index, side in enumerate(views.rig.sides):
        cam = folder / f"cam{index}"
        cam.mkdir(parents=True)
        _write(cam / "times.txt", times)
        lens = camera_text(views.rig.camera(side))
        if lens is None:
            has_unknown_lens = True
        else:
            _write(cam / "camera.txt", lens)
        if photometry:
            rays = views.rays_of(side, source.true_rig.camera(side))
            _write(cam / "pcalib.txt", response_text(photometry.response))
            write_png(cam / "vignette.png", _vignette(rays, photometry))
    if has_unknown_lens:
        notes.append("DSO has no model for such a lens, so there is no camera.txt.")
    return notes


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def response_text(response: Response) -> str:
    """The text of pcalib.txt: the linear signal, from 0 to 255, of each grey value."""
    signals_dn = linear_of_grey(response) * FULL_SCALE_DN
    return " ".join(map(repr, signals_dn.tolist())) + "\n"


def _vignette(rays: Array, photometry: Photometry) -> NDArray[np.uint16]:
    """The picture (H, W) of the share of light that the lens transmits, relative to the largest share."""
    share = transmitted_share(rays, photometry)
    vignette: NDArray[np.uint16] = np.rint(share / share.max() * WHITE_16).astype(np.uint16)
    return vignette


def transmitted_share(rays: Array, photometry: Photometry) -> Array:
    """The share of light (H, W) along rays (H, W, 3) that the lens transmits."""
    if not photometry.vignetting and photometry.cutoff_deg is None:
        return np.ones(rays.shape[:2])
    return vignetting(rays, strength=photometry.vignetting, cutoff_deg=photometry.cutoff_deg)


def camera_text(camera: Camera) -> str | None:
    """The text of DSO's camera.txt; None for a lens for which DSO has no model.

    The centre of the first pixel is at 0.5 in DSO, and at 0 in vobench.
    """
    width = camera.width_px
    height = camera.height_px
    fx, fy, cx, cy = focal_and_center_px(camera.K)
    relative = [
        fx / width,
        fy / height,
        (cx + 0.5) / width,
        (cy + 0.5) / height,
    ]
    match camera:
        case Pinhole():
            return _camera_lines("Pinhole", [*relative, 0.0], "none", camera)
        case BrownConrady() if not camera.k3:
            terms = [getattr(camera, name) for name in kalibr.RADTAN_TERMS]
            return _camera_lines("RadTan", [*relative, *terms], "crop", camera)
        case KannalaBrandt():
            terms = [getattr(camera, name) for name in camera.coefficients]
            return _camera_lines("EquiDistant", [*relative, *terms], "crop", camera)
        case _:
            return None


def _camera_lines(
    model: str,
    values: list[float],
    rectification: str,
    camera: Camera,
) -> str:
    numbers = " ".join(map(repr, values))
    size = f"{camera.width_px} {camera.height_px}"
    return f"{model} {numbers}\n{size}\n{rectification}\n{size}\n"


def _times(source: ExportSource, stamps: Stamps) -> tuple[str, list[str]]:
    """The text of times.txt for frames at stamps (N,), and notes on it."""
    exposed_ns, settings = source.sequence.exposures()
    row_of = dict(zip(exposed_ns.tolist(), settings.tolist(), strict=True))
    t_ns = stamps.tolist()
    rows = [row_of[t] for t in t_ns if t in row_of]
    if len(rows) < len(t_ns):
        lines = [f"{index:05d} {format_seconds(t)}\n" for index, t in enumerate(t_ns)]
        return "".join(lines), ["The exposure of some images is not known, so times.txt has no third column."]

    time_s, gain_db = np.array(rows, float).reshape(-1, 2).T
    notes = []
    if np.ptp(gain_db) > 0:
        time_s = time_s * 10 ** (gain_db / 20)
        notes.append("The gain changes, and times.txt has no column for it: the exposures are multiplied by it.")
    elif gain_db[0]:
        notes.append(f"The gain, constant at {gain_db[0]:g} dB, is not in times.txt, which has no column for it.")
    time_ms = (time_s * MS_PER_S).tolist()
    lines = []
    for index, (t, exposure_ms) in enumerate(zip(t_ns, time_ms, strict=True)):
        lines.append(f"{index:05d} {format_seconds(t)} {exposure_ms!r}\n")
    return "".join(lines), notes
