#!/usr/bin/env bash
# @foxglove/ulog 2.3.2: the value of a parameter in a PX4 log is replaced by its default.
#
# A ULog names each parameter with its value (message P) and, where the value differs from it, the default (message Q).
# The reader puts both under one key as `value`, and the later one wins: PX4 writes the defaults after the values, so
# that exactly the tuned parameters show their defaults. pyulog keeps them apart (6.5 and a default of 6.0).
# Seen: MC_ROLL_P value 6, defaultTypes 1; MC_PITCH_P value 7, defaultTypes 0
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund @foxglove/ulog@2.3.2
node - <<'JAVASCRIPT'
const fs = require("fs");
const { ULog } = require("@foxglove/ulog");
const { FileReader } = require("@foxglove/ulog/node");

function message(kind, ...parts) {
  const data = Buffer.concat(parts.map((part) => Buffer.from(part)));
  const head = Buffer.alloc(3);
  head.writeUInt16LE(data.length);
  head.write(kind, 2);
  return Buffer.concat([head, data]);
}
function float(key, value) {
  const bytes = Buffer.alloc(4);
  bytes.writeFloatLE(value);
  return Buffer.concat([Buffer.from([key.length]), Buffer.from(key), bytes]);
}
const sample = Buffer.alloc(10);
sample.writeBigUInt64LE(1000n, 2);
const log = Buffer.concat([
  Buffer.from("ULog\x01\x12\x35\x01", "latin1"),
  Buffer.alloc(8),
  message("B", Buffer.alloc(40)),
  message("F", "beat:uint64_t timestamp;"),
  message("P", float("float MC_ROLL_P", 6.5)),
  message("P", float("float MC_PITCH_P", 7)),
  message("Q", [1], float("float MC_ROLL_P", 6)),
  message("A", [0, 0, 0], "beat"),
  message("D", sample),
]);
fs.writeFileSync("log.ulg", log);

async function main() {
  const read = new ULog(new FileReader("log.ulg"));
  await read.open();
  const { parameters } = read.header;
  console.log(parameters);
  process.exit(parameters.get("MC_ROLL_P").value === 6 && parameters.get("MC_PITCH_P").value === 7 ? 0 : 1);
}
main();
JAVASCRIPT
