"""Reads files of datasets within limits, and converts pictures to 8-bit grey."""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.errors import InputError, enumerated
from vobench.sequence.picture import Header, Image, header
from vobench.trajectory.any_format import LFS_POINTER

MOST_NAME = 1024  # the largest number of characters of a path in a list
MOST_BYTES = 1 << 30  # the largest size of a file; an hour of IMU readings has a tenth of it
MOST_NAMES_SHOWN = 12
LONGEST_NAME_SHOWN = 200  # the largest number of characters of a name in a message


def read_bytes(path: Path) -> bytes:
    """The content of a file. Raises InputError if it is missing, too large, or a Git-LFS pointer."""
    try:
        if not path.is_file():
            problem = "not a file" if path.exists() else "no such file"
            raise InputError(f"{problem}: {path}")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise InputError(f"the file has {size} bytes; at most {MOST_BYTES} are read at once: {path}")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read {path}: {reason}") from None
    refuse_lfs_pointer(data, str(path))
    return data


def read_text(path: Path) -> str:
    """The text of a file in UTF-8. Raises InputError as in `read_bytes`, and if the file is not text."""
    data = read_bytes(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        offset = error.start
        raise InputError(f"not a text file in UTF-8 (byte {offset} is {data[offset]:#04x}): {path}") from None
    if "\0" in text:
        raise InputError(f"not a text file (it has a zero byte): {path}")
    return text


def refuse_lfs_pointer(data: bytes, name: str) -> None:
    """Raise InputError if the data is a Git-LFS pointer. `name` is the name of the file."""
    if data.startswith(LFS_POINTER.encode()):
        raise InputError(f"a Git-LFS pointer, not the file itself; fetch it with git lfs pull: {name}")


def refuse_lfs_pointers(folder: Path) -> None:
    """Raise InputError if a file in a folder is a Git-LFS pointer."""
    for name in listed(folder):
        path = folder / name
        if path.is_file():
            with path.open("rb") as file:
                start = file.read(len(LFS_POINTER))
            refuse_lfs_pointer(start, str(path))


def inside(folder: Path, name: str, place: str) -> Path:
    """The path of a file that a list names, relative to `folder`. `place` is the place in the list, for messages.

    Raises InputError for a name that leads out of the folder, because a list can be hostile.
    """
    relative = PurePosixPath(name.replace("\\", "/"))
    is_absolute = relative.is_absolute() or PureWindowsPath(name).drive != ""
    has_parent = ".." in relative.parts
    has_valid_length = 0 < len(name) <= MOST_NAME
    if not has_valid_length or is_absolute or has_parent:
        shown_name = name[:LONGEST_NAME_SHOWN]
        raise InputError(f"{place}: a file's name should stay inside {folder}, but is {shown_name!r}")
    return folder.joinpath(*relative.parts)


def listed(folder: Path) -> list[str]:
    """The names in a folder, sorted; empty if the folder does not exist."""
    try:
        return sorted(entry.name for entry in folder.iterdir())
    except (FileNotFoundError, NotADirectoryError):
        return []


def require_free(out: Path) -> None:
    """Raise InputError unless `out` does not exist or is an empty folder."""
    if not out.exists():
        return
    is_empty_folder = out.is_dir() and not any(out.iterdir())
    if not is_empty_folder:
        raise InputError(f"should be a new or empty folder, but exists and is not empty: {out}")


def unread(folder: Path, *used: str) -> tuple[str, ...]:
    """A note on the files and folders in a folder that were not read; empty if all were read.

    `used` are the names of those that were read. Hidden ones are not mentioned.
    """
    others = [name for name in listed(folder) if name not in used and not name.startswith(".")]
    if not others:
        return ()
    return (f"Not read: {enumerated(others, MOST_NAMES_SHOWN)}.",)


Form = Literal["png", "jpeg", "pixels"]
# The first bytes of files, and the last ones of a JPEG file.
PNG = b"\x89PNG\r\n\x1a\n"
JPEG = b"\xff\xd8\xff"
JPEG_END = b"\xff\xd9"
MOST_PIXELS = 1 << 26  # 67 megapixels; a header with more is damaged or malicious
GREY_SHARES = "0.299 red + 0.587 green + 0.114 blue"
COLOURS = {1: "grey", 2: "grey with alpha", 3: "colour", 4: "colour with alpha"}  # by the number of channels


@dataclass(frozen=True, slots=True)
class EncodedPicture:
    """The bytes of a PNG or JPEG file, or pixels (H, W) or (H, W, 3) with 8 or 16 bits, in the order blue, green, red.

    `name` is the name of the picture, for messages.
    """

    name: str
    content: bytes | NDArray[Any]


@dataclass(frozen=True, slots=True)
class Kind:
    """The size, the number of channels and the bits per channel of a picture. A grey picture has one channel."""

    width_px: int
    height_px: int
    channels: int
    bits: int
    form: Form

    @property
    def is_grey8(self) -> bool:
        """Whether a picture of this kind needs no conversion."""
        return self.channels == 1 and self.bits == 8

    def __str__(self) -> str:
        return f"{self.width_px} x {self.height_px} pixels, {self.bits}-bit {COLOURS[self.channels]}"


def kind_of(picture: EncodedPicture) -> Kind:
    """The kind of a picture. Raises InputError for a file that is cut off, or is neither PNG nor JPEG."""
    content = picture.content
    if not isinstance(content, bytes):
        height, width = content.shape[:2]
        channels = 1 if content.ndim == 2 else content.shape[2]
        bits = content.itemsize * 8
        return Kind(width, height, channels, bits, "pixels")

    refuse_lfs_pointer(content, picture.name)
    if not content.startswith((PNG, JPEG)):
        problem = f"it begins with {content[:8]!r}" if content else "it is empty"
        raise InputError(f"an image should be a PNG or JPEG file, but {problem}: {picture.name}")
    kind = _file_kind(content, picture.name)
    pixel_count = kind.width_px * kind.height_px
    if not 0 < pixel_count <= MOST_PIXELS:
        size = f"{kind.width_px} x {kind.height_px}"
        raise InputError(f"an image should have 1 to {MOST_PIXELS} pixels, but has {size}: {picture.name}")
    return kind


def grey(picture: EncodedPicture, kind: Kind) -> Image:
    """The picture (H, W) in 8-bit grey. Of 16 bits, the upper 8 are used. Raises InputError if it cannot be decoded."""
    content = picture.content
    pixels: NDArray[Any] = _decoded(picture, kind) if isinstance(content, bytes) else content
    if pixels.ndim == 3:
        blue_green_red = np.ascontiguousarray(pixels[..., :3])
        pixels = cv2.cvtColor(blue_green_red, cv2.COLOR_BGR2GRAY)
    if pixels.dtype == np.uint16:
        pixels = pixels >> 8
    return np.ascontiguousarray(pixels, np.uint8)


def as_file(picture: EncodedPicture, kind: Kind) -> tuple[bytes, str]:
    """The picture as an 8-bit grey PNG or JPEG file, and the form of the file. Raises InputError.

    A file that is 8-bit grey already is returned unchanged.
    """
    if isinstance(picture.content, bytes) and kind.is_grey8:
        return picture.content, kind.form
    pixels = grey(picture, kind)
    _, encoded = cv2.imencode(".png", pixels)
    return encoded.tobytes(), "png"


def conversions(kind: Kind) -> tuple[str, ...]:
    """Notes on how `grey` converts pictures of a kind."""
    notes = []
    if kind.channels > 2:
        notes.append(f"Colour images were converted to grey: {GREY_SHARES} (ITU-R BT.601).")
    if kind.channels in (2, 4):
        notes.append("The alpha channel of the images was dropped.")
    if kind.bits == 16:
        notes.append("Images of 16 bits were reduced to their upper 8 bits (divided by 256, rounded down).")
    elif kind.bits < 8:
        notes.append(f"Images of {kind.bits} bits were scaled to 8 bits.")
    return tuple(notes)


def _decoded(picture: EncodedPicture, kind: Kind) -> NDArray[Any]:
    """The pixels of a PNG or JPEG file. Raises InputError if they cannot be decoded, or differ from `kind` in size."""
    data = np.frombuffer(bytes(picture.content), np.uint8)
    try:
        pixels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error:
        pixels = None
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"the {kind.form.upper()} file does not decode: {picture.name}")
    if pixels.shape[:2] != (kind.height_px, kind.width_px):
        height, width = pixels.shape[:2]
        raise InputError(f"the header states {kind}, but {width} x {height} were decoded: {picture.name}")
    if pixels.ndim == 3 and kind.channels == 2:
        return pixels[..., 0]  # OpenCV decodes grey with alpha to three equal channels and alpha
    return pixels


def _file_kind(data: bytes, name: str) -> Kind:
    """The kind of the picture in a PNG or JPEG file. Raises InputError if the file is cut off or damaged."""
    if data.startswith(PNG):
        # The chunk tRNS adds an alpha channel that the header does not count.
        has_transparency = b"tRNS" in _png_chunks(data, name)
        png = _header(data, "PNG", name)
        return Kind(png.width, png.height, png.channels + has_transparency, png.bits, "png")

    without_padding = data.rstrip(b"\0")
    if not without_padding.endswith(JPEG_END):
        raise InputError(f"the JPEG is cut off after {len(data)} bytes: {name}")
    jpeg = _header(data, "JPEG", name)
    if jpeg.bits != 8 or jpeg.channels not in (1, 3):
        raise InputError(f"a JPEG should have 8 bits and 1 or 3 channels, not {jpeg.bits} and {jpeg.channels}: {name}")
    return Kind(jpeg.width, jpeg.height, jpeg.channels, jpeg.bits, "jpeg")


def _header(data: bytes, form: str, name: str) -> Header:
    """The header of a PNG or JPEG file. Raises InputError if it has none that is valid."""
    try:
        parsed = header(memoryview(data))
    except struct.error:
        parsed = None
    if parsed is None or not parsed.channels:
        raise InputError(f"the {form} has no valid header: {name}")
    return parsed


CHUNK_OVERHEAD = 12  # the bytes of a chunk besides its data: length, type and checksum
LENGTH_BYTES = 4
CHECKSUM_BYTES = 4


def _png_chunks(data: bytes, name: str) -> set[bytes]:
    """The types of the chunks in a PNG. Raises InputError for a wrong checksum, or if the end chunk is missing."""
    start = len(PNG)
    types = set()
    while start + CHUNK_OVERHEAD <= len(data):
        length, chunk_type = struct.unpack_from(">I4s", data, start)
        end = start + CHUNK_OVERHEAD + length
        if end > len(data):
            break

        # The checksum at the end of a chunk is that of its type and its data.
        type_and_data = memoryview(data)[start + LENGTH_BYTES : end - CHECKSUM_BYTES]
        (stored_checksum,) = struct.unpack_from(">I", data, end - CHECKSUM_BYTES)
        if zlib.crc32(type_and_data) != stored_checksum:
            raise InputError(f"the PNG is damaged (checksum of its chunk at byte {start}): {name}")
        types.add(chunk_type)
        start = end
        if chunk_type == b"IEND":
            return types
    raise InputError(f"the PNG is cut off after {len(data)} bytes: {name}")
