#!/usr/bin/env bash
# mcap 1.6.0 (Python), @mcap/core 2.2.2: one window of one file holds one message more in TypeScript.
#
# `end_time` of Python's `iter_messages` is exclusive (it is deprecated in favour of `ending_before`), `endTime` of
# `readMessages` in TypeScript inclusive. A recording that is read in windows of a second, the usual way to page through it,
# is complete in Python and has the messages on the borders twice in TypeScript; a window of one instant is empty in Python.
# Seen: Python [10, 20] and [], TypeScript [10, 20, 30] and [20]
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -q mcap==1.6.0
npm install --silent --no-audit --no-fund @mcap/core@2.2.2
venv/bin/python -W ignore - <<'PYTHON'
import sys

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

with open("log.mcap", "wb") as file:
    writer = Writer(file, compression=CompressionType.NONE)
    writer.start()
    channel = writer.register_channel("/height", "json", writer.register_schema("Height", "jsonschema", b"{}"))
    for time in (10, 20, 30):
        writer.add_message(channel, time, b"{}", time)
    writer.finish()


def window(start, end):
    with open("log.mcap", "rb") as file:
        return [message.log_time for _, _, message in make_reader(file).iter_messages(start_time=start, end_time=end)]


seen = window(10, 30), window(20, 20)
print("Python", *seen)
sys.exit(seen != ([10, 20], []))
PYTHON
node - <<'JAVASCRIPT'
const fs = require("fs");
const { McapIndexedReader } = require("@mcap/core");

const bytes = fs.readFileSync("log.mcap");
const readable = {
  size: async () => BigInt(bytes.length),
  read: async (offset, length) => new Uint8Array(bytes.subarray(Number(offset), Number(offset + length))),
};

async function main() {
  const reader = await McapIndexedReader.Initialize({ readable });
  const seen = [];
  for (const [startTime, endTime] of [[10n, 30n], [20n, 20n]]) {
    const times = [];
    for await (const message of reader.readMessages({ startTime, endTime })) times.push(Number(message.logTime));
    seen.push(times);
  }
  console.log("TypeScript", ...seen);
  process.exit(JSON.stringify(seen) === "[[10,20,30],[20]]" ? 0 : 1);
}
main();
JAVASCRIPT
