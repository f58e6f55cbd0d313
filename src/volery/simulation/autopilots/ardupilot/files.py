"""The files of a simulated ArduPilot: its logs, and its parameters packed into one file.

Ground stations read ``@PARAM/param.pck`` in place of a list of 1,400 messages.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import partial

from volery.base.time import S
from volery.simulation.autopilots.autopilot_parameters import INT8, INT16, INT32, VehicleParameters
from volery.simulation.autopilots.mavlink.file_service import Content, Encode, FilePolicy
from volery.simulation.autopilots.vehicle_state import AutopilotVehicle

PACKED = "@PARAM/param.pck"
_MAGIC = 0x671B
_PACKED_TYPES = {INT8: (1, "<b"), INT16: (2, "<h"), INT32: (3, "<i")}
_PACKED_REAL = (4, "<f")
_FAIL, _NOT_FOUND = 1, 10


def packed_parameters(parameters: VehicleParameters) -> bytes:
    """Return ``param.pck`` as AP_Filesystem_Param writes it: names are stated from where they differ."""
    rows, before = [], ""
    for name, kind, value, _ in parameters:
        number, form = _PACKED_TYPES.get(kind, _PACKED_REAL)
        differs = (at for at, (one, other) in enumerate(zip(before, name, strict=False)) if one != other)
        shared = min(next(differs, min(len(before), len(name))), 15, len(name) - 1)
        head = bytes((number, shared | len(name) - shared - 1 << 4))
        rows.append(head + name[shared:].encode() + struct.pack(form, value if form == "<f" else int(value)))
        before = name
    return struct.pack("<HHH", _MAGIC, len(rows), len(rows)) + b"".join(rows)


def onboard_files(vehicle: AutopilotVehicle, encode: Encode) -> Mapping[str, Content]:
    """Return the packed parameters, and the logs with their numbers as ArduPilot names them."""
    files: dict[str, Content] = {PACKED: lambda: packed_parameters(vehicle.parameters)}
    for number, log in enumerate(vehicle.logs, 1):
        files[f"logs/{number:08}.BIN"] = partial(encode, log)
    if vehicle.logs:
        files["logs/LASTLOG.TXT"] = f"{len(vehicle.logs)}\r\n".encode
    return files


FILES = FilePolicy(
    onboard_files,
    relative=True,
    entry_end=b"\0\0",
    dots=(b"D.", b"D.."),
    burst=500,
    unopened=_NOT_FOUND,
    taken=_FAIL,
    unknown=_FAIL,
    own_session=False,
    expires=3 * S,
)
