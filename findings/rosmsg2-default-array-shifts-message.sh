#!/usr/bin/env bash
# @foxglove/rosmsg2-serialization 3.1.0: a default array is written with length 0 and its elements after it.
#
# `int32[] trim [1, 2, 3]` is a ROS 2 field with a default value. `MessageWriter` takes the default where the message has no such
# field, writes the length of what is not there, 0, and then the three numbers. Every receiver of the CDR reads
# an empty array and takes the elements for the fields that follow: the altitude of 120 is gone.
# Seen: trim [], altitude 1 (its own reader)
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @foxglove/rosmsg@5.0.5 @foxglove/rosmsg2-serialization@3.1.0
node - <<'JAVASCRIPT'
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");

const definition = parse("int32[] trim [1, 2, 3]\nint32 altitude", { ros2: true });
const bytes = new MessageWriter(definition).writeMessage({ altitude: 120 });
const read = new MessageReader(definition).readMessage(bytes);
const given = new MessageWriter(definition).writeMessage({ trim: [1, 2, 3], altitude: 120 });
console.log(Buffer.from(bytes).toString("hex"), read);
console.log(Buffer.from(given).toString("hex"), new MessageReader(definition).readMessage(given));
process.exit(read.trim.length === 0 && read.altitude === 1 && bytes.length === given.length ? 0 : 1);
JAVASCRIPT
