#!/usr/bin/env bash
# pyulog 1.3.0: a topic whose samples carry their trailing padding is missing from the log.
#
# The ULog format lets a writer leave out padding at the end of a message ("might not be logged"), so both lengths
# are valid. pyulog drops the padding fields first and adds up the longest allowed sample afterwards: a sample with its
# padding is longer, is taken for corruption and skipped. A log of two equal topics, one with and one without the four
# bytes, shows one topic; nothing is raised or printed.
# Seen: topics ['bare'], file_corruption True
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q pyulog==1.3.0 numpy==2.4.6
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import pathlib
import struct
import sys

from pyulog import ULog


def message(kind, data):
    return struct.pack("<HB", len(data), ord(kind)) + data


log = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + message("B", bytes(40))
for name in (b"bare", b"padded"):
    log += message("F", name + b":uint64_t timestamp;float height;uint8_t[4] _padding0;")
for number, name in enumerate((b"bare", b"padded")):
    log += message("A", struct.pack("<BH", 0, number) + name)
log += message("D", struct.pack("<HQf", 0, 1000, 2.5))
log += message("D", struct.pack("<HQf4x", 1, 1000, 2.5))
file = pathlib.Path(sys.argv[1], "log.ulg")
file.write_bytes(log)
read = ULog(str(file))
topics = [data.name for data in read.data_list]
print("topics", topics, "file_corruption", read.file_corruption)
sys.exit((topics, read.file_corruption) != (["bare"], True))
PYTHON
