"""Pictures of datasets: their files, and any format to 8-bit grey."""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.errors import InputError
from vobench.sequence.picture import Image, header
from vobench.trajectory.formats import LFS_POINTER

MOST_NAME = 1024  # characters of a file's name in a list, folders and all
MOST_BYTES = 1 << 30  # an hour of IMU readings is a tenth of it


def read_bytes(path: Path) -> bytes:
    """A file's bytes. Raises InputError where there is no file, it is huge, or a Git-LFS pointer stands for it."""
    try:
        if not path.is_file():
            raise InputError(f"{'not a file' if path.exists() else 'no such file'}: {path}")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"{size} bytes, and {MOST_BYTES} is the most that is read at once: {path}")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(f"cannot read {path}: {getattr(error, 'strerror', None) or error}") from None
    require_itself(data, str(path))
    return data


def read_text(path: Path) -> str:
    """A text file in UTF-8. Raises InputError as `read_bytes` does, and where it is no text."""
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"not a text file in UTF-8 (byte {error.start} is {data[error.start]:#04x}): {path}") from None
    if "\0" in text:
        raise InputError(f"not a text file (it has a zero byte): {path}")
    return text


def require_itself(data: bytes, name: str) -> None:
    """Raise InputError for a Git-LFS pointer."""
    if data.startswith(LFS_POINTER.encode()):
        raise InputError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")


def require_themselves(folder: Path) -> None:
    """Raise InputError for the first file of a folder that is a Git-LFS pointer."""
    for name in listed(folder):
        if (folder / name).is_file():
            with (folder / name).open("rb") as file:
                require_itself(file.read(len(LFS_POINTER)), str(folder / name))


def inside(folder: Path, name: str, place: str) -> Path:
    """The file that a list names, below `folder`. Raises InputError for a name that is absolute or climbs out."""
    parts = PurePosixPath(name.replace("\\", "/"))
    if not 0 < len(name) <= MOST_NAME or parts.is_absolute() or PureWindowsPath(name).drive or ".." in parts.parts:
        raise InputError(f"{place}: a file's name should stay inside {folder}, but is {name[:200]!r}")
    return folder.joinpath(*parts.parts)


def listed(folder: Path) -> list[str]:
    """The names in a folder, sorted; none where there is no such folder."""
    try:
        return sorted(entry.name for entry in folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def require_free(out: Path) -> None:
    """Raise InputError unless a folder may be made there."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"should be a new or empty folder, but there is something: {out}")


def unread(folder: Path, *used: str) -> tuple[str, ...]:
    """The sentence on what lies in a folder and was not read, where there is something."""
    others = [name for name in listed(folder) if name not in used and not name.startswith(".")]
    some = ", ".join(others[:12]) + (f" and {len(others) - 12} more" if len(others) > 12 else "")
    return (f"Not read: {some}.",) if others else ()


Form = Literal["png", "jpeg", "pixels"]
PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
JPEG_END = b"\xff\xd9"
MOST_PIXELS = 1 << 26  # 67 megapixels; a header that asks for more is a mistake or a trap
GREY_SHARES = "0.299 red + 0.587 green + 0.114 blue"


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG's or JPEG's bytes, or pixels (H, W) or (H, W, 3) blue, green, red, 8 or 16 bits; a name for messages."""

    name: str
    content: bytes | NDArray[Any]


@dataclass(frozen=True, slots=True)
class Kind:
    """What a picture's header says: size, channels and bits of each. A grey one has one channel and no alpha."""

    width_px: int
    height_px: int
    channels: int
    bits: int
    form: Form

    @property
    def is_grey8(self) -> bool:
        """Whether nothing needs to be converted."""
        return self.channels == 1 and self.bits == 8

    def __str__(self) -> str:
        colour = {1: "grey", 2: "grey with alpha", 3: "colour", 4: "colour with alpha"}[self.channels]
        return f"{self.width_px} x {self.height_px} pixels, {self.bits}-bit {colour}"


def kind_of(picture: Picture) -> Kind:
    """The kind of a picture, and that it is whole. Raises InputError for what is no PNG or JPEG, or cut off."""
    if not isinstance(picture.content, bytes):
        height, width = picture.content.shape[:2]
        channels = 1 if picture.content.ndim == 2 else picture.content.shape[2]
        return Kind(width, height, channels, picture.content.itemsize * 8, "pixels")
    require_itself(picture.content, picture.name)
    if not picture.content.startswith((PNG, JPEG)):
        begins = "it is empty" if not picture.content else f"it begins with {picture.content[:8]!r}"
        raise InputError(f"a picture should be a PNG or JPEG file, but {begins}: {picture.name}")
    kind = _file_kind(picture.content, picture.name)
    if not 0 < kind.width_px * kind.height_px <= MOST_PIXELS:
        raise InputError(f"{kind.width_px} x {kind.height_px} pixels are no picture: {picture.name}")
    return kind


def grey(picture: Picture, kind: Kind) -> Image:
    """The picture (H, W) in 8-bit grey; of 16 bits the upper eight. Raises InputError where it does not decode."""
    pixels = picture.content if isinstance(picture.content, np.ndarray) else _decoded(picture, kind)
    if pixels.ndim == 3:
        pixels = cv2.cvtColor(np.ascontiguousarray(pixels[..., :3]), cv2.COLOR_BGR2GRAY)
    if pixels.dtype == np.uint16:
        pixels = pixels >> 8
    return np.ascontiguousarray(pixels, np.uint8)


def as_file(picture: Picture, kind: Kind) -> tuple[bytes, str]:
    """An 8-bit grey PNG or JPEG and which it is: the found file itself where it is that. Raises InputError."""
    if isinstance(picture.content, bytes) and kind.is_grey8:
        return picture.content, kind.form
    return cv2.imencode(".png", grey(picture, kind))[1].tobytes(), "png"


def conversions(kind: Kind) -> tuple[str, ...]:
    """Sentences on what `grey` does to pictures of a kind."""
    said = []
    if kind.channels > 2:
        said.append(f"Colour pictures were turned grey: {GREY_SHARES} (ITU-R BT.601).")
    if kind.channels in (2, 4):
        said.append("The pictures' alpha channel was dropped.")
    if kind.bits == 16:
        said.append("Pictures of 16 bits were cut to their upper 8 bits (divided by 256, rounded down).")
    elif kind.bits < 8:
        said.append(f"Pictures of {kind.bits} bits were spread over 8 bits.")
    return tuple(said)


def _decoded(picture: Picture, kind: Kind) -> NDArray[Any]:
    try:
        pixels = cv2.imdecode(np.frombuffer(bytes(picture.content), np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"the {kind.form.upper()} file does not decode: {picture.name}")
    if pixels.shape[:2] != (kind.height_px, kind.width_px):
        raise InputError(f"the header says {kind}, but {pixels.shape[1]} x {pixels.shape[0]} decode: {picture.name}")
    if pixels.ndim == 3 and kind.channels == 2:
        return pixels[..., 0]  # OpenCV repeats a grey channel that has an alpha
    return pixels


def _file_kind(data: bytes, name: str) -> Kind:
    form: Form = "png" if data.startswith(PNG) else "jpeg"
    if form == "jpeg" and not data.rstrip(b"\0").endswith(JPEG_END):
        raise InputError(f"the JPEG is cut off after {len(data)} bytes: {name}")
    alpha = form == "png" and b"tRNS" in _png_chunks(data, name)
    try:
        _, height, width, bits, channels = header(memoryview(data))
    except struct.error:
        channels = 0
    if not channels:
        raise InputError(f"the {form.upper()} has no header that makes sense: {name}")
    if form == "jpeg" and (bits != 8 or channels not in (1, 3)):
        raise InputError(f"a JPEG should have 8 bits and 1 or 3 channels, not {bits} and {channels}: {name}")
    return Kind(width, height, channels + alpha, bits, form)


def _png_chunks(data: bytes, name: str) -> set[bytes]:
    """The kinds of its chunks; every one's checksum is right, and the last is the end."""
    place = len(PNG)
    kinds = set()
    while place + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, place)
        end = place + 12 + length
        if end > len(data):
            break
        if zlib.crc32(memoryview(data)[place + 4 : end - 4]) != struct.unpack_from(">I", data, end - 4)[0]:
            raise InputError(f"the PNG is damaged (checksum of its chunk at byte {place}): {name}")
        kinds.add(kind)
        place = end
        if kind == b"IEND":
            return kinds
    raise InputError(f"the PNG is cut off after {len(data)} bytes: {name}")
