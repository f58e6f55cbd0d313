#!/usr/bin/env bash
# @foxglove/rostime 1.1.3, rosmsg2-serialization 3.1.0: a duration of -0.5 s arrives as +3.8 s.
#
# ROS writes it as -1 s and 500000000 ns; nanoseconds are never negative. `subtract` does so. `fromSec(-0.5)` and
# `fromMillis(-500)` answer 0 s and -500000000 ns; `toSec` of it is right, so nothing looks odd, and the writer puts the
# negative number into the unsigned field without an error.
# Seen: subtract -1/500000000, fromSec 0/-500000000, after a ROS 2 message 3.794967
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @foxglove/rostime@1.1.3 @foxglove/rosmsg@5.0.5 @foxglove/rosmsg2-serialization@3.1.0
node - <<'JAVASCRIPT'
const time = require("@foxglove/rostime");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");

const text = `builtin_interfaces/Duration wait
===
MSG: builtin_interfaces/Duration
int32 sec
uint32 nanosec`;
const definition = parse(text, { ros2: true });
const wait = time.fromSec(-0.5);
const bytes = new MessageWriter(definition).writeMessage({ wait: { sec: wait.sec, nanosec: wait.nsec } });
const { wait: read } = new MessageReader(definition).readMessage(bytes);
const difference = time.subtract({ sec: 1, nsec: 0 }, { sec: 1, nsec: 500000000 });
const arrived = Math.round(time.toSec({ sec: read.sec, nsec: read.nanosec }) * 1e6) / 1e6;
console.log("subtract", difference, "fromSec", wait, "arrived", arrived);
process.exit(difference.sec === -1 && wait.nsec === -500000000 && arrived === 3.794967 ? 0 : 1);
JAVASCRIPT
