#!/usr/bin/env bash
# pynmea2 1.19.0: a GSV sentence of NMEA 4.10 and later gains a satellite that is not there.
#
# Since NMEA 4.10 GSV ends with a signal id. The sentence below names one satellite (number 1, elevation 40,
# azimuth 83, 46 dB) and signal id 1. pynmea2 takes the id for the number of a second satellite, without a warning:
# a program that counts the `sv_prn_num_` fields counts one satellite too many in every such sentence.
# Seen: num_sv_in_view 01, sv_prn_num_1 01, sv_prn_num_2 1
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pynmea2==1.19.0
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import pynmea2

sentence = pynmea2.parse("$GPGSV,1,1,01,01,40,083,46,1*59")
seen = sentence.num_sv_in_view, sentence.sv_prn_num_1, sentence.sv_prn_num_2
print(seen)
sys.exit(seen != ("01", "01", "1"))
PYTHON
