"""Resources of the execution platform beside processors and networks: memory spaces, software, devices.

They are the middle of the allocation chain: an instance is allocated to a memory space (a process), that to
an operating system, and that to a processor. A link of the chain may be left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from volery.base import units
from volery.base.errors import Location
from volery.model.fields import (
    DATA_SIZE,
    FREQUENCY,
    NETWORK,
    PROCESSOR,
    TEXT,
    ListOf,
    MapOf,
    OneOf,
    QuantityField,
    Record,
    Shorter,
    Whole,
)

CACHE_TYPES = ("data", "instruction", "unified")
IPC = ("FIFO", "socket", "messageQueue", "sharedMemory", "file")
"""Mechanisms of communication between processes (S3D's InterProcessCommunicationMechanism)."""

DEVICE_KINDS = ("sensor", "actuator", "device")
POWER = QuantityField(units.POWER, least=0)


@dataclass(frozen=True, slots=True)
class MemorySpace:
    """A process: instances in it share its memory (MARTE's MemoryPartition)."""

    name: str
    memory_b: Annotated[float | None, DATA_SIZE, "Memory that it may take."] = None
    description: Annotated[str, TEXT, "What it is for."] = ""
    where: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class OperatingSystem:
    """An operating system of a computer."""

    name: str
    type: Annotated[str, TEXT, "What it is, such as `Debian 12` or `FreeRTOS`."] = ""
    ipc: Annotated[str, OneOf(IPC), "How processes on it communicate."] = "socket"
    drivers: Annotated[tuple[str, ...], ListOf(TEXT, bare=True), "Drivers of devices that it has."] = ()
    description: Annotated[str, TEXT, "What it is for."] = ""
    where: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Device:
    """A sensor, an actuator or another device of a computer."""

    name: str
    kind: Annotated[str, OneOf(DEVICE_KINDS), "Kind of device."]
    on: Annotated[str | None, PROCESSOR, "The computer that it is connected to."] = None
    bus: Annotated[str | None, NETWORK, "The network that connects it."] = None
    driver: Annotated[str, TEXT, "Driver that serves it."] = ""
    path: Annotated[str, TEXT, "Where the operating system shows it, such as `/dev/ttyUSB0`."] = ""
    description: Annotated[str, TEXT, "What it is."] = ""
    where: Location | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Cache:
    """A cache of a processor."""

    name: str
    size_b: Annotated[float | None, DATA_SIZE, "Its size."] = None
    level: Annotated[int, Whole(least=1), "Its level, 1 next to the core."] = 1
    type: Annotated[str, OneOf(CACHE_TYPES), "What it holds."] = "unified"


@dataclass(frozen=True, slots=True)
class PowerState:
    """A state that a processor can be in, with what it draws (S3D's HwPowerState)."""

    name: str
    frequency_hz: Annotated[float | None, FREQUENCY, "Frequency of all its cores."] = None
    static_w: Annotated[float | None, POWER, "Power without any activity."] = None
    total_w: Annotated[float | None, POWER, "Power under full load."] = None
    description: Annotated[str, TEXT, "When it is used."] = ""


CACHES = MapOf(Record(Cache))
POWER_STATES = MapOf(Record(PowerState))
MEMORY_SPACES = MapOf(Shorter(Record(MemorySpace), empty=True), values_only=True)
OPERATING_SYSTEMS = MapOf(Shorter(Record(OperatingSystem), empty=True), values_only=True)
DEVICES = MapOf(Record(Device), values_only=True)
