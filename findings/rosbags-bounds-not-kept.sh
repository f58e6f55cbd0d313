#!/usr/bin/env bash
# rosbags 0.11.9: bounds of a message definition are parsed and not kept when a message is written.
#
# `string<=3` and `int32[<=2]` are the definition's promise to every receiver. rosbags knows the bounds, yet
# serialises a string of six characters and three numbers without an error, and reads them back; a bag that it
# writes can hold messages that no node of ROS 2 could have published. A default value (`float32 gain 1.5`) is parsed
# and dropped: the class wants an argument for the field.
# Seen: 'abcdef' [1, 2, 3]; no default
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q rosbags==0.11.9 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import sys

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
store.register(get_types_from_msg("string<=3 name\nint32[<=2] numbers\nfloat32 gain 1.5", "own_msgs/msg/Bounded"))
Bounded = store.types["own_msgs/msg/Bounded"]
three = np.array([1, 2, 3], dtype=np.int32)
written = store.serialize_cdr(Bounded("abcdef", three, 2.0), Bounded.__msgtype__)
read = store.deserialize_cdr(written, Bounded.__msgtype__)
try:
    Bounded("abc", three[:2])
    default = "a default"
except TypeError:
    default = "no default"
print(repr(read.name), read.numbers.tolist(), default)
sys.exit((read.name, read.numbers.tolist(), default) != ("abcdef", [1, 2, 3], "no default"))
PYTHON
