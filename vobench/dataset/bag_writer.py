"""Writes sequences as ROS 2 bags."""

import json
from pathlib import Path
from typing import Final

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, ReaderError, StoragePlugin, Writer

from vobench.dataset.rectified_view import Views
from vobench.dataset.source import ExportSource
from vobench.errors import SequenceError
from vobench.sequence.bag import Bag
from vobench.sequence.message_type import TYPES
from vobench.sequence.topic import (
    CASE_ATTACHMENT,
    IMPORT_NOTE,
    IMU_NOTE,
    NAMES_ATTACHMENT,
    PROVENANCE_NOTE,
    SENSORS_FILE,
    TF_STATIC,
    TRUTH_FILE,
    WHEELS_NOTE,
)

TRUE_TF_STATIC = f"/ground_truth{TF_STATIC.name}"
VERSION: Final = 8  # the version of rosbag2's metadata, which ROS 2 Iron and later can read
NOTE_NAMES = (WHEELS_NOTE, IMU_NOTE, PROVENANCE_NOTE, IMPORT_NOTE)
ATTACHMENT_NAMES = (CASE_ATTACHMENT, NAMES_ATTACHMENT)


def write_ros2(source: ExportSource, views: Views, folder: Path) -> list[str]:
    """Write every message of a sequence's two files unchanged, and return notes on what was converted."""
    del views  # a bag contains the pictures as recorded
    paths = [source.folder / name for name in (SENSORS_FILE, TRUTH_FILE)]
    paths = [path for path in paths if path.is_file()]
    true_mounts_differ = len({_mounts(path) for path in paths}) > 1

    folder.rmdir()  # rosbags creates the folder
    writer = Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    for name, text in _custom_data(paths).items():
        writer.set_custom_data(name, text)
    try:
        with AnyReader(paths, default_typestore=TYPES) as reader, writer:
            _copy(reader, writer, true_mounts_differ=true_mounts_differ)
    except (AnyReaderError, ReaderError) as error:
        raise SequenceError(f"rosbags does not read this sequence ({error}): {source.folder}") from error

    notes = ["Notes and attachments (wheels, IMU, case, versions) became custom_data of metadata.yaml."]
    if true_mounts_differ:
        notes.append(f"The true mounts differ from the nominal ones: they are on {TRUE_TF_STATIC}.")
    return notes


def _mounts(path: Path) -> tuple[bytes, ...]:
    """The messages on /tf_static, as bytes."""
    return tuple(bytes(data) for _, data in Bag.open(path).raw((TF_STATIC,)))


def _custom_data(paths: list[Path]) -> dict[str, str]:
    texts = {}
    for path in paths:
        bag = Bag.open(path)
        for name in NOTE_NAMES:
            entries = bag.note(name)
            if entries:
                texts[name] = json.dumps(entries, sort_keys=True)
        for name in ATTACHMENT_NAMES:
            if bag.has_attachment(name):
                texts[name] = bag.attachment(name).decode()
    return texts


def _copy(reader: AnyReader, writer: Writer, *, true_mounts_differ: bool) -> None:
    """Copy every message with its time. The /tf_static of the truth is renamed, or dropped if it is the same."""
    copies = {}  # the connections of the new bag, by the id of the original connection
    for connection in reader.connections:
        name = _copied_name(connection, reader, true_mounts_differ=true_mounts_differ)
        if name is None or not connection.msgcount:
            continue
        copies[id(connection)] = writer.add_connection(
            name,
            connection.msgtype,
            msgdef=connection.msgdef.data,
            rihs01=TYPES.hash_rihs01(connection.msgtype),
            offered_qos_profiles=getattr(connection.ext, "offered_qos_profiles", ()),
        )
    for connection, t_ns, data in reader.messages():
        copy = copies.get(id(connection))
        if copy is not None:
            writer.write(copy, t_ns, data)


def _copied_name(
    connection: Connection,
    reader: AnyReader,
    *,
    true_mounts_differ: bool,
) -> str | None:
    """The name of a topic in the new bag; None for the truth's /tf_static if it equals that of the sensors."""
    is_of_sensors = connection.owner is reader.connections[0].owner  # the sensor file is the first one
    if connection.topic != TF_STATIC.name or is_of_sensors:
        return connection.topic
    return TRUE_TF_STATIC if true_mounts_differ else None
