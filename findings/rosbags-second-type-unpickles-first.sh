#!/usr/bin/env bash
# rosbags 0.11.9: registering a second type makes messages of the first one impossible to pickle.
#
# Each call of Typestore.register puts its classes into a new module that takes the place of the last one under the
# same name in sys.modules. A message of an earlier call still works, but pickle, which finds classes by module and
# name, no longer finds its class: what went to another process yesterday fails after an unrelated registration.
# Seen: pickled; then PicklingError: attribute lookup own_msgs__msg__One on rosbags.usertypes failed
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q rosbags==0.11.9 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import pickle
import sys

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

store = get_typestore(Stores.ROS2_JAZZY)
store.register(get_types_from_msg("int32 a", "own_msgs/msg/One"))
message = store.types["own_msgs/msg/One"](a=1)
before = pickle.loads(pickle.dumps(message)).a
store.register(get_types_from_msg("int32 b", "own_msgs/msg/Two"))
try:
    pickle.dumps(message)
    after = "pickled"
except pickle.PicklingError as error:
    after = f"PicklingError: {error}"
print(before, after)
sys.exit(not (before == 1 and "attribute lookup own_msgs__msg__One on rosbags.usertypes failed" in after))
PYTHON
