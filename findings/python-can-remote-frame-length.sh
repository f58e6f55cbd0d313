#!/usr/bin/env bash
# python-can 4.6.1: the candump log forgets the length of a remote frame, the BLF log keeps it.
#
# A remote frame that asks for four bytes is logged and read again. Its length is part of what goes over the bus.
# `CanutilsLogWriter` writes `7FF#R` without it, so that a replay of the `.log` asks for zero bytes; through `.blf` it is
# four. Neither warns.
# Seen: log 0, blf 4
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q python-can==4.6.1
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys

import can

seen = []
for ending in ("log", "blf"):
    file = f"{sys.argv[1]}/bus.{ending}"
    with can.Logger(file) as logger:
        logger(can.Message(timestamp=1.7e9, arbitration_id=0x7FF, is_extended_id=False, is_remote_frame=True, dlc=4))
    with can.LogReader(file) as reader:
        seen += [message.dlc for message in reader]
print(seen)
sys.exit(seen != [0, 4])
PYTHON
