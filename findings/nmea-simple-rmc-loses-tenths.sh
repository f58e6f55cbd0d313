#!/usr/bin/env bash
# nmea-simple 3.3.0: all ten RMC sentences of a second have the same time.
#
# NMEA 0183 lets the seconds have any number of decimals, and a 10 Hz receiver sends 0.1 to 0.9. `parseNmeaSentence` keeps
# the fraction of an RMC sentence only where it has exactly two digits: .5 and .500 become .000, .50 stays. The same field
# of GLL and ZDA is right. A track out of RMC moves once a second, in jumps.
# Seen: RMC .5 -> 000, .50 -> 500, .500 -> 000; GLL 500 500 500
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund nmea-simple@3.3.0
node - <<'JAVASCRIPT'
const { parseNmeaSentence } = require("nmea-simple");

function sentence(body) {
  const sum = [...body].reduce((value, letter) => value ^ letter.charCodeAt(0), 0);
  return `$${body}*${sum.toString(16).toUpperCase().padStart(2, "0")}`;
}
const seen = [".5", ".50", ".500"].map((part) => [
  parseNmeaSentence(sentence(`GPRMC,081836${part},A,3751.65,S,14507.36,E,0.0,360.0,291126,,,A`)).datetime,
  parseNmeaSentence(sentence(`GPGLL,3751.65,S,14507.36,E,081836${part},A,A`)).time,
].map((time) => time.getUTCMilliseconds()));
console.log(seen);
process.exit(JSON.stringify(seen) === "[[0,500],[500,500],[0,500]]" ? 0 : 1);
JAVASCRIPT
