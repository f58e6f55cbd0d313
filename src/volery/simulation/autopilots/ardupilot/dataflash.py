"""A recorded flight as ArduPilot's DataFlash log: formats, parameters, texts, then the samples in time.

Message names, columns, units and scales are those of ArduPilot 4.5 (AP_Logger, ``LogStructure.h``), which
pymavlink, MAVExplorer and the log review of ground stations read by name.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from math import degrees, hypot

from volery.base.elementary import atan2
from volery.base.time import S
from volery.simulation.autopilots.ardupilot.feature import LogForm
from volery.simulation.autopilots.ardupilot.versions import ArduPilotVersion
from volery.simulation.autopilots.mavlink.messages import EPOCH_US
from volery.simulation.autopilots.onboard_log import FlightLog, LogSample

GPS_EPOCH_S, LEAP_SECONDS, WEEK_S = 315_964_800, 18, 604_800
"""Start of GPS time in UNIX time, and how far it is ahead of UTC in 2026 [s]."""

_HEAD = b"\xa3\x95"
_CODES = {
    "B": "B",
    "Q": "Q",
    "f": "f",
    "I": "I",
    "L": "i",
    "H": "H",
    "M": "B",
    "c": "h",
    "N": "16s",
    "Z": "64s",
    "n": "4s",
}
"""Format letters of DataFlash to those of ``struct``."""


class _Form(LogForm):
    """A type of message that is written."""

    def layout(self) -> struct.Struct:
        return struct.Struct("<2sB" + "".join(_CODES[letter] for letter in self.letters))

    def row(self, *values: object) -> bytes:
        return self.layout().pack(_HEAD, self.number, *values)


FMT = _Form(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
PARM = _Form(129, "PARM", "QNff", "TimeUS,Name,Value,Default")
MSG = _Form(130, "MSG", "QZ", "TimeUS,Message")
MODE = _Form(131, "MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn")
ARM = _Form(132, "ARM", "QBIBB", "TimeUS,ArmState,ArmChecks,Forced,Method")
ATT = _Form(133, "ATT", "Qfff", "TimeUS,Roll,Pitch,Yaw")
POS = _Form(134, "POS", "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt")
GPS = _Form(135, "GPS", "QBBIHBcLLffff", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ")
BAT = _Form(136, "BAT", "QBffffB", "TimeUS,Inst,Volt,VoltR,Curr,CurrTot,RemPct")
EV = _Form(139, "EV", "QB", "TimeUS,Id")
ARMED_EVENT, DISARMED_EVENT = 10, 11
FORMS = (FMT, PARM, MSG, MODE, ARM, EV, ATT, POS, GPS, BAT)


def encode(log: FlightLog, version: ArduPilotVersion, added: Sequence[LogForm]) -> bytes:
    """Return a log in DataFlash format; *added* are the messages of ``FlightLog.extras``."""
    extra_forms = {form.name: _Form(*form) for form in added}
    name = "ArduCopter" if log.flies else "ArduRover"
    samples = list(log.samples())
    start = round(samples[0].time_us) if samples else 0
    out = [
        FMT.row(
            form.number,
            form.layout().size,
            form.name.encode(),
            form.letters.encode(),
            form.columns.encode(),
        )
        for form in (*FORMS, *extra_forms.values())
    ]
    out.append(MSG.row(start, f"{name} {version.text}".encode()))
    out += [
        PARM.row(start, parameter.name.encode(), parameter.value, parameter.value)
        for parameter in log.parameters
    ]
    out += [ARM.row(start, 1, 0, 0, 1), EV.row(start, ARMED_EVENT)]
    mode = -1.0
    for sample, extras in zip(samples, log.extras, strict=True):
        if sample.mode != mode:
            mode = sample.mode
            out.append(MODE.row(round(sample.time_us), int(mode), int(mode), 0))
        out += _rows(log, sample, start)
        out += [_extra_row(sample, extra_forms[name], values) for name, values in extras]
    if samples:
        end = round(samples[-1].time_us)
        out += [ARM.row(end, 0, 0, 0, 1), EV.row(end, DISARMED_EVENT)]
    return b"".join(out)


def _extra_row(sample: LogSample, form: _Form, values: tuple[float, ...]) -> bytes:
    """Return a row of the firmware's own at the time of a sample."""
    fitting = (
        int(one) if letter in "BI" else one for letter, one in zip(form.letters[1:], values, strict=True)
    )
    return form.row(round(sample.time_us), *fitting)


def _rows(log: FlightLog, sample: LogSample, start: int) -> list[bytes]:
    """Return the messages of one sample; *start* is the time of the log's first one [us]."""
    time = round(sample.time_us)
    place = round(sample.latitude * 1e7), round(sample.longitude * 1e7)
    utc_ms = (EPOCH_US + log.started_at * 1_000_000 // S + time - start) // 1000
    week, in_week = divmod(utc_ms - (GPS_EPOCH_S - LEAP_SECONDS) * 1000, WEEK_S * 1000)
    course = degrees(atan2(sample.v_east, sample.v_north)) % 360.0
    speed = hypot(sample.v_north, sample.v_east)
    hdop = min(round(sample.hdop * 100.0), 32_767)
    receiver = 0, int(sample.fix), in_week, week, int(sample.satellites), hdop
    used = 0, sample.volts, sample.volts, sample.amps, sample.used_mah, round(sample.left * 100.0)
    return [
        ATT.row(time, degrees(sample.roll), degrees(sample.pitch), degrees(sample.yaw) % 360.0),
        POS.row(time, *place, sample.amsl, log.home_down - sample.down, -sample.down),
        GPS.row(time, *receiver, *place, sample.amsl, speed, course, sample.v_down),
        BAT.row(time, *used),
    ]
