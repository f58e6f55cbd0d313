#!/usr/bin/env bash
# georinex 1.16.2: a comment between two epochs of a RINEX 3 file hides all that follows it.
#
# Special records (flag 2 to 5) may stand between epochs, and RINEX lets their time fields be blank where the time does not
# matter. At such a record `load` stops, without a word: of three epochs two are gone. With the time filled in, all three
# are there; but flag 6, a list of repaired cycle slips, is then read as observations: a phase of 3 cycles.
# Seen: epochs 1 with the blank time, 3 with a time; cycle slips read as L1C [105000000.456, 3.0]
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


head = (
    line("     3.04           OBSERVATION DATA    G: GPS", "RINEX VERSION / TYPE")
    + line("test                test                20260101 000000 UTC", "PGM / RUN BY / DATE")
    + line("  4027894.0000   307046.0000  4919474.0000", "APPROX POSITION XYZ")
    + line("        0.0000        0.0000        0.0000", "ANTENNA: DELTA H/E/N")
    + line("G    2 C1C L1C", "SYS / # / OBS TYPES")
    + line("    30.000", "INTERVAL")
    + line("  2026     1     1     0     0    0.0000000     GPS", "TIME OF FIRST OBS")
    + line("", "END OF HEADER")
)


def epoch(minute):
    return f"> 2026 01 01 00 {minute:02}  0.0000000  0  1\nG05  20000000.123   105000000.456  \n"


def read(name, middle):
    file = pathlib.Path(sys.argv[1], name)
    file.write_text(head + epoch(0) + middle + epoch(1) + epoch(2))
    return georinex.load(file)


comment = line("antenna cleaned", "COMMENT")
blank = read("BLANK.rnx", ">" + " " * 30 + "4  1\n" + comment)
timed = read("TIMED.rnx", "> 2026 01 01 00 00 30.0000000  4  1\n" + comment)
slips = read("SLIPS.rnx", "> 2026 01 01 00 00 30.0000000  6  1\nG05" + " " * 16 + "         3.000  \n")
seen = len(blank.time), len(timed.time), slips.L1C.values[:2, 0].tolist()
print(*seen)
sys.exit(seen != (1, 3, [105000000.456, 3.0]))
PYTHON
