"""Evaluates expressions with a client library and its messages: ``values.py LIBRARY FILE``.

Writes a line of JSON: for each line of the file the type and representation of its value, or the kind of
error.
"""

import array
import copy
import io
import json
import pathlib
import pickle
import re
import sys

import numpy as np


def names_of_rclpy():
    import rclpy
    from rclpy.serialization import deserialize_message, serialize_message

    def sent(message):
        """Return the message as it arrives."""
        return deserialize_message(serialize_message(message), type(message))

    rclpy.init()
    return locals()


def names_of_rospy():

    def sent(message):
        """Return the message as it arrives."""
        buffer = io.BytesIO()
        message.serialize(buffer)
        return type(message)().deserialize(buffer.getvalue())

    return locals()


def described(expression, names):
    try:
        value = eval(expression, names)
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
