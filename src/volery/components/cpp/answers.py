"""What any C++ component may ask: time, sleep, costs, words, its parameters and its required ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.components import services
from volery.components.cpp.errors import Exited
from volery.components.cpp.interfaces import Operation
from volery.components.stand_ins import EPOCH
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.ros.client_libraries.wire import Answer, CppFlow, Reader, Writer
from volery.vehicles import Drone

STICKS = 1000
"""Full deflection of a stick in the calls of ``I_RosDron``."""


@dataclass(frozen=True)
class Connected:
    """A required port's operations by name, and what it is connected to. Operations are empty for drones."""

    operations: Mapping[str, Operation]
    targets: Sequence[Any]


def answers(
    kernel: Kernel, name: str, parameters: Mapping[str, Any], ports: Mapping[str, Connected]
) -> dict[str, Answer]:
    """What the component called *name* is answered. *ports* may be filled until it first asks."""
    return {**_services(kernel), **_ports(name, ports), "parameter": _Parameters(name, parameters)}


def _services(kernel: Kernel) -> dict[str, Answer]:
    def now(flow: CppFlow, asked: Reader) -> bytes:
        return Writer().real(services.now()).done()

    def monotonic(flow: CppFlow, asked: Reader) -> bytes:
        with kernel:
            return Writer().integer(kernel.now()).done()

    def time_of_day(flow: CppFlow, asked: Reader) -> bytes:
        with kernel:
            return Writer().integer(EPOCH + kernel.now()).done()

    def sleep(flow: CppFlow, asked: Reader) -> bytes:
        services.sleep(asked.real())
        return b""

    def sleep_ns(flow: CppFlow, asked: Reader) -> bytes:
        duration: Ns = asked.integer()
        waiting.sleep(kernel, duration)
        return b""

    return {
        "now": now,
        "monotonic": monotonic,
        "time_of_day": time_of_day,
        "sleep": sleep,
        "sleep_ns": sleep_ns,
        "add_time": _add_time,
        "log": _log,
        "note": _note,
        "exit": _exit,
    }


def _add_time(flow: CppFlow, asked: Reader) -> bytes:
    seconds, at_mhz, joules = asked.real(), asked.real(), asked.real()
    services.add_time(seconds, at_mhz or None, joules)
    return b""


def _log(flow: CppFlow, asked: Reader) -> bytes:
    services.log(asked.text(), asked.text())
    return b""


def _note(flow: CppFlow, asked: Reader) -> bytes:
    services.note(asked.text(), asked.text(), asked.text(), asked.text())
    return b""


def _exit(flow: CppFlow, asked: Reader) -> bytes:
    raise Exited(asked.integer())


class _Parameters:
    """``volery::parameter<T>(name)``."""

    def __init__(self, component: str, values: Mapping[str, Any]) -> None:
        self._component, self._values = component, values

    def __call__(self, flow: CppFlow, asked: Reader) -> bytes:
        name, kind = asked.text(), asked.text()
        if name not in self._values:
            hint = did_you_mean(name, self._values)
            raise UsageError(f"{self._component} has no parameter {name!r}{hint}: {choices(self._values)}")
        value = self._values[name]
        if kind == "float" and type(value) in (int, float):
            return Writer().real(value).done()
        if kind in ("int", "bool") and type(value).__name__ == kind:
            return Writer().integer(value).done()
        if kind == "str" and isinstance(value, str):
            return Writer().text(value).done()
        raise UsageError(f"{self._component}: parameter {name!r} is {value!r}, which is no {kind}")


def _ports(name: str, ports: Mapping[str, Connected]) -> dict[str, Answer]:
    def connected(flow: CppFlow, asked: Reader) -> bytes:
        return Writer().integer(len(ports[asked.text()].targets)).done()

    def call(flow: CppFlow, asked: Reader) -> bytes:
        port = ports[asked.text()]
        target, operation = port.targets[asked.integer()], port.operations[asked.text()]
        arguments = [kind.read(asked) for _, kind in operation.arguments]
        result = getattr(target, operation.name)(*arguments)
        written = Writer()
        operation.returns.write(written, result)
        return written.done()

    def drone(flow: CppFlow, asked: Reader) -> bytes:
        found = _drone(name, ports, asked.text(), asked.integer())
        _DRONE[asked.text()](found, Reader(asked.raw()))
        return b""

    return {"connected": connected, "port": call, "drone": drone}


def _drone(name: str, ports: Mapping[str, Connected], port: str, index: int) -> Drone:
    drones = [one for one in ports.values() if not one.operations]
    if port:
        found = ports[port].targets[index]
    elif len(drones) == 1 and len(drones[0].targets) == 1:
        found = drones[0].targets[0]
    else:
        count = sum(len(one.targets) for one in drones)
        raise UsageError(
            f"{name}: uc_drone_...() is for a component that commands one drone, but it is connected to "
            f"{count}: require one port of the interface Drone, or take I_RosDron& in the constructor"
        )
    assert isinstance(found, Drone)
    return found


def _go(drone: Drone, asked: Reader) -> None:
    latitude, longitude, altitude = asked.real(), asked.real(), asked.real()
    drone.goto(Position(latitude, longitude, AMSL(altitude)))


def _joystick(drone: Drone, asked: Reader) -> None:
    pitch, roll, throttle, yaw = (asked.integer() / STICKS for _ in range(4))
    drone.manual_control(pitch, roll, throttle, yaw)


_DRONE: Mapping[str, Callable[[Drone, Reader], None]] = {
    "gps_fly": lambda drone, asked: drone.takeoff(asked.real()),
    "gps_go": _go,
    "return_ground": lambda drone, asked: drone.return_home(),
    "joystick": _joystick,
    "stabilize_fly": lambda drone, asked: drone.stabilize(),
    "alt_hold_fly": lambda drone, asked: drone.altitude_hold(),
    "land_ground": lambda drone, asked: drone.land(),
}
