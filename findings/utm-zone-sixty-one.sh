#!/usr/bin/env bash
# utm 1.1.1 (npm): the date line lies in zone 61, and its own inverse refuses what it has made.
#
# UTM has the zones 1 to 60, and 180 degrees is the west border of zone 1. `fromLatLon(47, 180)` answers zone 61 with the
# coordinates that belong to it; `toLatLon` of this raises "zone number out of range". For -180, the same meridian, it answers
# zone 1. Python's package of the same name takes both as zone 1.
# Seen: zones 61 and 1 with the same easting, out of range
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund utm@1.1.1
node - <<'JAVASCRIPT'
const utm = require("utm");

const east = utm.fromLatLon(47, 180);
const west = utm.fromLatLon(47, -180);
let said = "";
try {
  utm.toLatLon(east.easting, east.northing, east.zoneNum, east.zoneLetter);
} catch (error) {
  said = error.message;
}
console.log(east, west, said);
const same = Math.round(east.easting) === Math.round(west.easting);
process.exit(east.zoneNum === 61 && west.zoneNum === 1 && same && said.includes("out of range") ? 0 : 1);
JAVASCRIPT
