#!/usr/bin/env bash
# node-mavlink 2.3.0: packets of MAVLink 1 carry the extension fields that MAVLink 1 does not have.
#
# Extension fields exist in MAVLink 2 only; the guide says that they are not sent in MAVLink 1. MISSION_COUNT has four bytes
# of payload there and five more as extensions. `MavLinkProtocolV1.serialize`, the protocol that `send` takes by default,
# writes all nine, and says nine in the length: a receiver that checks the length of the message drops it.
# Seen: payload of 9 bytes
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund node-mavlink@2.3.0
node - <<'JAVASCRIPT'
const { MavLinkProtocolV1, common } = require("node-mavlink");

const count = new common.MissionCount();
Object.assign(count, { targetSystem: 1, targetComponent: 1, count: 3, missionType: 1, opaqueId: 5 });
const packet = new MavLinkProtocolV1(255, 190).serialize(count, 0);
const bare = common.MissionCount.FIELDS.filter((field) => !field.extension);
const size = bare.reduce((sum, field) => sum + field.size, 0);
console.log(packet.toString("hex"), "payload", packet[1], "of MAVLink 1", size);
process.exit(packet[1] === 9 && packet.length === 17 && size === 4 ? 0 : 1);
JAVASCRIPT
