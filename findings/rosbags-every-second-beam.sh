#!/usr/bin/env bash
# rosbags 0.11.9: a message whose array is a view of every second element cannot be written, nor two messages compared.
#
# `scan[::2]` is the usual way to thin a laser scan and has the right type, float32. `serialize_cdr` raises a ValueError
# about "the last axis must be contiguous", which names neither field nor message; `np.ascontiguousarray` helps.
# Messages are dataclasses with `==`, which raises as soon as they hold an array of two elements.
# Seen: ValueError ... contiguous; ValueError ... ambiguous
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q rosbags==0.11.9 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy as np
from rosbags.typesys import Stores, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
name = "std_msgs/msg/Float32MultiArray"
Array, Layout = store.types[name], store.types["std_msgs/msg/MultiArrayLayout"]
beams = np.arange(6, dtype=np.float32)


def said(function):
    try:
        return str(function())
    except ValueError as error:
        return f"ValueError: {error}"


thinned = said(lambda: bytes(store.serialize_cdr(Array(Layout([], 0), beams[::2]), name)))
copied = bytes(store.serialize_cdr(Array(Layout([], 0), np.ascontiguousarray(beams[::2])), name))
equal = said(lambda: Array(Layout([], 0), beams) == Array(Layout([], 0), beams.copy()))
print(thinned, "|", len(copied), "bytes |", equal)
sys.exit(not ("contiguous" in thinned and "ambiguous" in equal))
PYTHON
