"""One ROS 2 bag of both files of a sequence: a folder with metadata.yaml and an MCAP file."""

import json
from pathlib import Path
from typing import Final

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, ReaderError, StoragePlugin, Writer

from vobench.dataset.source import Source
from vobench.dataset.views import Views
from vobench.errors import SequenceError
from vobench.sequence.bag import Bag
from vobench.sequence.calibration import IMU_NOTE, WHEELS_NOTE
from vobench.sequence.messages import TF_STATIC, TYPES
from vobench.sequence.writer import (
    CASE_ATTACHMENT,
    IMPORT_NOTE,
    NAMES_ATTACHMENT,
    PROVENANCE_NOTE,
    SENSORS_FILE,
    TRUTH_FILE,
)

TRUE_TF_STATIC = f"/ground_truth{TF_STATIC.name}"
VERSION: Final = 8  # of rosbag2's metadata; ROS 2 Iron and later read it


def write_ros2(source: Source, views: Views, folder: Path) -> list[str]:
    """Write every message of both files, bit for bit, and say what became of the rest."""
    del views  # a bag holds the pictures as they were recorded
    paths = [path for path in (source.folder / SENSORS_FILE, source.folder / TRUTH_FILE) if path.is_file()]
    mounts = [tuple(bytes(data) for _, data in Bag.open(path).raw((TF_STATIC,))) for path in paths]
    folder.rmdir()  # rosbags makes its own
    writer = Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    for name, text in _records(paths).items():
        writer.set_custom_data(name, text)
    try:
        with AnyReader(paths, default_typestore=TYPES) as reader, writer:
            _copy(reader, writer, true_mounts_differ=len(set(mounts)) > 1)
    except (AnyReaderError, ReaderError) as error:
        raise SequenceError(f"rosbags does not read this sequence ({error}): {source.folder}") from error
    notes = ["Notes and attachments (wheels, IMU, case, versions) became custom_data of metadata.yaml."]
    if len(set(mounts)) > 1:
        notes.append(f"The true mounts differ from those told: they are on {TRUE_TF_STATIC}.")
    return notes


def _records(paths: list[Path]) -> dict[str, str]:
    """What no message holds, by the name it has in the sequence."""
    records = {}
    for path in paths:
        bag = Bag.open(path)
        for name in (WHEELS_NOTE, IMU_NOTE, PROVENANCE_NOTE, IMPORT_NOTE):
            if entries := bag.note(name):
                records[name] = json.dumps(entries, sort_keys=True)
        for name in (CASE_ATTACHMENT, NAMES_ATTACHMENT):
            if name in bag.index.attachments:
                records[name] = bag.attachment(name).decode()
    return records


def _copy(reader: AnyReader, writer: Writer, *, true_mounts_differ: bool) -> None:
    """Every message at its time; both files' /tf_static would be one topic, so the truth's is renamed or dropped."""
    names = [_name(connection, reader, true_mounts_differ=true_mounts_differ) for connection in reader.connections]
    into = {
        id(connection): writer.add_connection(
            name,
            connection.msgtype,
            msgdef=connection.msgdef.data,
            rihs01=TYPES.hash_rihs01(connection.msgtype),
            offered_qos_profiles=getattr(connection.ext, "offered_qos_profiles", ()),
        )
        for connection, name in zip(reader.connections, names, strict=True)
        if name and connection.msgcount
    }
    for connection, t_ns, data in reader.messages():
        if id(connection) in into:
            writer.write(into[id(connection)], t_ns, data)


def _name(connection: Connection, reader: AnyReader, *, true_mounts_differ: bool) -> str | None:
    """A topic's name in the bag; None for a message that is there already. The sensors' file comes first."""
    if connection.topic != TF_STATIC.name or connection.owner is reader.connections[0].owner:
        return connection.topic
    return TRUE_TF_STATIC if true_mounts_differ else None
