#!/usr/bin/env bash
# mcap 1.6.0: `reverse=True` reads a file without chunks forwards, without an error.
#
# An MCAP file with and one without chunks hold the same three messages. `iter_messages(reverse=True)` is the cheap way
# to the last state of a robot: the first message that it yields. Of the chunked file that is the newest message, of the
# file written with `use_chunking=False` it is the oldest one.
# Seen: chunked 30 20 10, not chunked 10 20 30
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q mcap==1.6.0
"$folder/venv/bin/python" - <<'PYTHON'
import io
import sys

from mcap.reader import make_reader
from mcap.writer import Writer


def read_in_reverse(use_chunking):
    file = io.BytesIO()
    writer = Writer(file, use_chunking=use_chunking)
    writer.start()
    channel = writer.register_channel("/state", "json", 0)
    for time in (10, 20, 30):
        writer.add_message(channel, log_time=time, data=b"{}", publish_time=time)
    writer.finish()
    file.seek(0)
    return [message.log_time for _, _, message in make_reader(file).iter_messages(reverse=True)]


seen = read_in_reverse(True), read_in_reverse(False)
print("chunked", *seen[0], "| not chunked", *seen[1])
sys.exit(seen != ([30, 20, 10], [10, 20, 30]))
PYTHON
