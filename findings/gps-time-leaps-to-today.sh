#!/usr/bin/env bash
# gps 0.9.0: in a replayed log the time leaps between the day of the log and today.
#
# RMC has date and time, GGA the time alone. `update` merges both into `state.time`: after the RMC it is in 2020, where
# the log was made, after the GGA of the next second it is today, with the time of the log. The documentation says that
# the state keeps what sentences said and names no clock of the machine. The difference of two states is years.
# Seen: 2020 after RMC, not 2020 after GGA, 2020 after the next RMC
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund gps@0.9.0
node - <<'JAVASCRIPT'
const GPS = require("gps");

function sentence(body) {
  const sum = [...body].reduce((value, letter) => value ^ letter.charCodeAt(0), 0);
  return `$${body}*${sum.toString(16).toUpperCase().padStart(2, "0")}`;
}
const gps = new GPS();
const seen = [
  "GPRMC,081836.00,A,3751.65,S,14507.36,E,0.0,360.0,020120,,,A",
  "GPGGA,081837.00,3751.65,S,14507.36,E,1,08,0.9,10.0,M,1.0,M,,",
  "GPRMC,081838.00,A,3751.65,S,14507.36,E,0.0,360.0,020120,,,A",
].map((body) => {
  gps.update(sentence(body));
  return gps.state.time.toISOString();
});
console.log(seen);
const years = seen.map((time) => time.startsWith("2020-01-02"));
process.exit(JSON.stringify(years) === "[true,false,true]" ? 0 : 1);
JAVASCRIPT
