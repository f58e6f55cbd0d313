#!/usr/bin/env bash
# node-mavlink 2.3.0: a message of zeros is cut to no payload at all, one byte shorter than MAVLink 2 allows.
#
# A MAVLink 2 sender drops zeros from the end of the payload, but never the first byte, "even if the payload consists
# entirely of zeros". A request for all parameters of system 0, component 0 has two zero bytes and so a payload of one;
# pymavlink sends fd01. node-mavlink sends a length of 0, and so another checksum.
# Seen: fd00...
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund node-mavlink@2.3.0
node - <<'JAVASCRIPT'
const { MavLinkProtocolV2, common } = require("node-mavlink");

const request = new common.ParamRequestList();
Object.assign(request, { targetSystem: 0, targetComponent: 0 });
const packet = new MavLinkProtocolV2(255, 190).serialize(request, 0);
console.log(packet.toString("hex"), "length", packet[1]);
process.exit(packet[1] === 0 && packet.length === 12 ? 0 : 1);
JAVASCRIPT
