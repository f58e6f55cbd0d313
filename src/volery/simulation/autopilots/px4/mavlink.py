"""PX4's MAVLink, for any kind of vehicle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from volery.base.time import MS
from volery.simulation.autopilots.mavlink.command import DENIED, FAILED, Handler
from volery.simulation.autopilots.mavlink.firmware import (
    MavlinkFirmware,
    MissionUploadPolicy,
    ParameterPolicy,
    StatusTextPolicy,
)
from volery.simulation.autopilots.px4 import boot, commands, missions
from volery.simulation.autopilots.px4.tables import ORDER, USES, builders
from volery.simulation.autopilots.vehicle_state import Vehicle

Hear = Callable[[Vehicle, dict[str, Any], int], None]

TEXTS = StatusTextPolicy(numbered=True, to_stations=True, spacing=48 * MS)
"""Recorded: at most one text each 48 to 52 ms."""

PARAMETERS = ParameterPolicy(
    burst=20,
    period=20 * MS,
    read_delay=2 * MS,
    bytewise=True,
    keeps_index=True,
    typed=True,
    checksum="_HASH_CHECK",
)
"""Recorded: 877 parameters in 0.85 s."""


def _no_streams(_vehicle: Vehicle, _index: int, _stream: int, _rate: int) -> None:
    """REQUEST_DATA_STREAM means nothing to PX4."""


def _refuse_interval(_vehicle: Vehicle, _number: int) -> int:
    return FAILED


def mavlink(kind: int, commanded: Mapping[int, Handler], heard: Mapping[str, Hear]) -> MavlinkFirmware:
    """*kind* is the MAV_TYPE of the heartbeat; *commanded* and *heard* are what it obeys."""
    return MavlinkFirmware(
        heartbeat_from=boot.FIRST_HEARTBEAT,
        answer_delay=6 * MS,
        uses=USES,
        mode_told=(),
        home_told=("GPS_GLOBAL_ORIGIN",),
        texts=TEXTS,
        parameter_habits=PARAMETERS,
        upload_habits=MissionUploadPolicy(
            missions.asks_with, received="", turns_to_integers=True, keeps_old=True
        ),
        wrong_target=FAILED,
        reads_nan=True,
        messages=builders(kind),
        message_order=ORDER,
        streams={},
        on_stream_request=_no_streams,
        refuse_interval=_refuse_interval,
        unknown_message=DENIED,
        commands=commanded,
        handlers=heard,
        set_mode=commands.set_mode,
        set_mode_ack=commands.DO_SET_MODE,
        on_parameter_list=boot.nothing,
        mission_runs=missions.runs,
        stored_item=missions.stored_item,
        home_item=missions.no_home_item,
        go_to_item=missions.goes_nowhere,
        mission_grew=missions.grew,
    )
