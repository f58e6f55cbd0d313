#!/usr/bin/env bash
# nmea-simple 3.3.0: a field that the receiver left empty is read as 0, so a standing vehicle heads due north.
#
# In NMEA 0183 an empty field means that the value is not known. A receiver at rest sends VTG without a course and GGA
# without the height of the geoid. The parser makes both 0, which are values: north, and a geoid on the ellipsoid (it is
# 100 m off in places). The package gps answers null for both.
# Seen: nmea-simple trackTrue 0, geoidalSeperation 0; gps null, null
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
npm install --silent --no-audit --no-fund nmea-simple@3.3.0 gps@0.9.0
node - <<'JAVASCRIPT'
const GPS = require("gps");
const { parseNmeaSentence } = require("nmea-simple");

function sentence(body) {
  const sum = [...body].reduce((value, letter) => value ^ letter.charCodeAt(0), 0);
  return `$${body}*${sum.toString(16).toUpperCase().padStart(2, "0")}`;
}
const course = sentence("GPVTG,,T,,M,0.00,N,0.00,K,A");
const fix = sentence("GPGGA,081836.00,3751.65,S,14507.36,E,1,08,0.9,10.0,M,,M,,");
const first = [parseNmeaSentence(course).trackTrue, parseNmeaSentence(fix).geoidalSeperation];
const second = [GPS.Parse(course).track, GPS.Parse(fix).geoidal];
console.log("nmea-simple", first, "gps", second);
process.exit(JSON.stringify([first, second]) === "[[0,0],[null,null]]" ? 0 : 1);
JAVASCRIPT
