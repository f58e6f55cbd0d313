#!/usr/bin/env bash
# python-can 4.6.1: a CAN FD frame comes out of a CSV or SQLite log as a classic frame of twelve bytes.
#
# Neither log has a column for the FD flag. The frame is written and read without a word; what is read is no frame that
# could exist, `can.Message(check=True)` refuses the same arguments.
# Seen: csv (False, 12), db (False, 12), log (True, 12); check: ValueError
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q python-can==4.6.1
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys

import can

seen = []
for ending in ("csv", "db", "log"):
    file = f"{sys.argv[1]}/bus.{ending}"
    with can.Logger(file) as logger:
        logger(can.Message(timestamp=1.7e9, arbitration_id=0x123, is_extended_id=False, is_fd=True, data=range(12)))
    with can.LogReader(file) as reader:
        seen += [(message.is_fd, message.dlc) for message in reader]
try:
    can.Message(arbitration_id=0x123, is_extended_id=False, data=range(12), check=True)
    refused = ""
except ValueError as error:
    refused = str(error)
print(seen, "|", refused)
sys.exit(seen != [(False, 12), (False, 12), (True, 12)] or not refused)
PYTHON
