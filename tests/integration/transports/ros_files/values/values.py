"""Evaluates expressions with a client library and its messages: ``values.py LIBRARY FILE``.

Writes a line of JSON: for each line of the file the type and representation of its value, or the kind of
error.
"""

import array
import copy
import importlib
import io
import json
import pathlib
import pickle
import re
import sys

import numpy as np

MODULES = {
    "geometry": "geometry_msgs.msg",
    "sensor": "sensor_msgs.msg",
    "srv": "std_srvs.srv",
    "std": "std_msgs.msg",
}
"""Modules by the names that expressions give them; imported by name, since only expressions use them."""


def imported(**modules):
    return {label: importlib.import_module(name) for label, name in {**MODULES, **modules}.items()}


def names_of_rclpy():
    names = imported(
        rclpy="rclpy", time="rclpy.time", duration="rclpy.duration", times="builtin_interfaces.msg"
    )
    serialization = importlib.import_module("rclpy.serialization")

    def sent(message):
        """Return the message as it arrives."""
        return serialization.deserialize_message(serialization.serialize_message(message), type(message))

    names["rclpy"].init()
    names |= {"Time": names["time"].Time, "Duration": names["duration"].Duration, "sent": sent}
    names["ClockType"] = importlib.import_module("rclpy.clock").ClockType
    return names | {"TimeMsg": names["times"].Time, "DurationMsg": names["times"].Duration}


def names_of_rospy():
    names = imported(rospy="rospy", genpy="genpy", numpy_messages="rospy.numpy_msg")

    def sent(message):
        """Return the message as it arrives."""
        buffer = io.BytesIO()
        message.serialize(buffer)
        return type(message)().deserialize(buffer.getvalue())

    return names | {"numpy_msg": names["numpy_messages"].numpy_msg, "sent": sent}


def described(expression, names):
    try:
        value = eval(expression, names)
    except NameError:
        raise
    except Exception as error:
        return f"raises {type(error).__name__}"
    return re.sub("0x[0-9a-f]+", "", f"{type(value).__name__}: {value!r}")


def main():
    library, file = sys.argv[1:3]
    names = {"array": array.array, "copy": copy, "np": np, "pickle": pickle}
    names.update(names_of_rclpy() if library == "rclpy" else names_of_rospy())

    def through(kind, value):
        """Return the field ``data`` of a message as it arrives."""
        message = kind()
        message.data = value
        return names["sent"](message).data

    names["through"] = through
    expressions = [line for line in pathlib.Path(file).read_text(encoding="utf-8").splitlines() if line]
    sys.stdout.write("VALUES " + json.dumps([described(one, names) for one in expressions]) + "\n")


if __name__ == "__main__":
    main()
