"""One instance of a firmware: what it is started for, and what it consists of once it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from pathlib import Path
from typing import NamedTuple

from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.real_firmware.exchange import SimulationPort
from volery.simulation.real_firmware.firmware_process import FirmwareProcess
from volery.simulation.real_firmware.ground_link import TelemetryPort


class Assignment(NamedTuple):
    """What an instance is started for.

    Args:
        name: Name of the vehicle.
        flight: Its body.
        program: The firmware.
        folder: Folder of the instance, new or of an earlier run of it.
        parameters: Parameters by name; they win over those that fit the firmware to the body.
        system: MAVLink system id.
        repeatable: Whether its answers are to be the same in each run; it keeps no log then.
    """

    name: str
    flight: Flight
    program: Path
    folder: Path
    parameters: Mapping[str, float]
    system: int
    repeatable: bool


class FirmwareInstance(NamedTuple):
    """An instance that runs.

    Args:
        process: Its process.
        exchange: Its simulation port.
        connection: Its telemetry port.
        mode_name: Returns the name of a ``custom_mode`` of HEARTBEAT.
        kinds: Values of MAV_TYPE that fit the body.
        arms_lost: Whether its arming checks pass before its estimator has a position.
        parameters: Names of the parameters that it must have; they are read back after its boot.
    """

    process: FirmwareProcess
    exchange: SimulationPort
    connection: TelemetryPort
    mode_name: Callable[[int], str]
    kinds: tuple[int, ...]
    arms_lost: bool = False
    parameters: Set[str] = frozenset()
