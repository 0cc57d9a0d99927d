"""Readers that nobody here wrote, from files alone: the JavaScript that Foxglove is made of, and Rerun's loader."""

import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vobench.geometry.rig import ImuCalibration
from vobench.sensor.imu import ImuReadings
from vobench.sequence import Sequence, SequenceWriter

PACKAGES = "@mcap/core @foxglove/rosmsg @foxglove/rosmsg2-serialization fzstd"
INSTALL = f"npm install --prefix FOLDER {PACKAGES}, then set NODE_PATH to FOLDER/node_modules"

# Decodes every message by the definition in the file; of each topic: type, count, last stamp, bytes of the picture.
LIST = """
const fs = require("fs"), { McapIndexedReader } = require("@mcap/core"), { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization"), { decompress } = require("fzstd");
(async () => {
  const data = fs.readFileSync(process.argv[1]);
  const read = async (at, n) => data.subarray(Number(at), Number(at + n));
  const readable = { size: async () => BigInt(data.length), read };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd: (b) => decompress(b) } });
  const out = {}, readers = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId), schema = reader.schemasById.get(channel.schemaId);
    const text = new TextDecoder().decode(schema.data);
    readers[channel.id] ??= new MessageReader(parse(text, { ros2: true }));
    const content = readers[channel.id].readMessage(message.data);
    const stamp = (content.header ?? content.transforms[0].header).stamp;
    const row = (out[channel.topic] ??= { type: schema.name, count: 0 });
    row.count += 1;
    row.last = stamp.sec + " " + (stamp.nsec ?? stamp.nanosec);
    row.bytes = content.data?.length ?? 0;
  }
  console.log(JSON.stringify(out));
})();
"""


@pytest.fixture(scope="module", params=["stereo with an IMU", "one camera"])
def written(request, recording, tmp_path_factory):
    """A sequence with all the topics there are, or with the fewest."""
    folder, pair = tmp_path_factory.mktemp("written"), request.param != "one camera"
    rig = replace(recording.rig, imu=ImuCalibration(np.eye(4), 100.0, 1e-3, 1e-2, 1e-5, 1e-4))
    if not pair:
        rig = replace(rig, right=None, T_body_right=None, wheels=None, imu=None)
    with SequenceWriter(folder, rig, case_json=b"{}", start_ns=10**18) as writer:
        for index in range(5):
            t_ns = 10**18 + index * 700_000_000
            if pair:
                writer.write_imu(ImuReadings(np.array([t_ns]), np.zeros((1, 3)), np.ones((1, 3))))
                writer.write_imu_bias(t_ns, np.zeros(3), np.ones(3))
                writer.write_encoders([t_ns], [[index, -index]])
                writer.write_disturbance(t_ns, np.zeros(3), np.zeros(2))
            writer.write_frame(t_ns, recording.left[index], recording.right[index] if pair else None)
            writer.write_exposure(t_ns, 0.01, 6.0)
            writer.write_truth(t_ns, np.eye(4), None)
    return folder


@pytest.mark.parametrize("name", ["sensors.mcap", "truth.mcap"])
def test_foxgloves_libraries_decode_every_message(written, counts, name):
    found = javascript(written / name)
    assert {topic: row["count"] for topic, row in found.items()} == counts(written / name)
    last = {row["last"] for topic, row in found.items() if row["count"] > 1}
    assert last == {"1000000002 800000000"}
    if name == "sensors.mcap":
        (*_, frame) = Sequence.open(written).encoded_frames()
        assert found["/cam_left/image/compressed"]["bytes"] == len(frame.left)


def javascript(path):
    node = shutil.which("node")
    if not node or not os.environ.get("NODE_PATH"):
        pytest.skip(f"needs Node.js and: {INSTALL}")
    done = subprocess.run([node, "-e", LIST, path], capture_output=True, text=True, check=False)
    if "Cannot find module" in done.stderr:
        pytest.skip(INSTALL)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", ["sensors.mcap", "truth.mcap"])
def test_rerun_lists_every_topic_and_has_no_complaint(written, counts, name):
    """By its text: its exit code is 0 whatever it finds."""
    there = counts(written / name)
    listed = rerun("info", written / name)
    rows = re.findall(r"^\s*\d+\s+(/\S+)\s+(\d+)\s.*ros2msg / cdr$", listed, re.MULTILINE)
    assert {topic: int(count) for topic, count in rows} == there
    assert re.search(r"Profile +ros2", listed)
    checked = rerun("check", "--full", written / name)
    assert set(re.findall(r"^ok\s+\d+\s+\d+\s+(/\S+)\s+—\s*$", checked, re.MULTILINE)) == there.keys()


def rerun(*arguments):
    environment = {**os.environ, "NO_COLOR": "1"}
    done = subprocess.run(
        [Path(sys.executable).parent / "rerun", "mcap", *arguments],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    return done.stdout + done.stderr
