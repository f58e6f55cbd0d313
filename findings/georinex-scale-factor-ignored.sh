#!/usr/bin/env bash
# georinex 1.16.2: observations stored with a scale factor are read a hundred times too large.
#
# A RINEX 3 header line `SYS / SCALE FACTOR` says that the named observations are stored multiplied by 10, 100 or 1000
# and are to be divided before use, a way to keep more digits of the carrier phase. georinex reads over the line: the phase
# of 1050000.00456 cycles comes out as 105000000.456, without a warning, and the line is not among the attributes.
# Seen: L1C 105000000.456, C1C 20000000.123
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q georinex==1.16.2 xarray==2026.9.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import sys
import warnings

import georinex

warnings.simplefilter("ignore", FutureWarning)


def line(text, label):
    return f"{text:<60}{label:<20}\n"


text = (
    line("     3.04           OBSERVATION DATA    G: GPS", "RINEX VERSION / TYPE")
    + line("test                test                20260101 000000 UTC", "PGM / RUN BY / DATE")
    + line("  4027894.0000   307046.0000  4919474.0000", "APPROX POSITION XYZ")
    + line("        0.0000        0.0000        0.0000", "ANTENNA: DELTA H/E/N")
    + line("G    2 C1C L1C", "SYS / # / OBS TYPES")
    + line("G  100  1 L1C", "SYS / SCALE FACTOR")
    + line("    30.000", "INTERVAL")
    + line("  2026     1     1     0     0    0.0000000     GPS", "TIME OF FIRST OBS")
    + line("", "END OF HEADER")
    + "> 2026 01 01 00 00  0.0000000  0  1\n"
    + "G05  20000000.123   105000000.456  \n"
)
file = pathlib.Path(sys.argv[1], "TEST.rnx")
file.write_text(text)
read = georinex.load(file)
seen = float(read.L1C[0, 0]), float(read.C1C[0, 0]), sorted(read.attrs)
print(*seen)
sys.exit(seen[:2] != (105000000.456, 20000000.123) or "SCALE" in str(seen[2]).upper())
PYTHON
