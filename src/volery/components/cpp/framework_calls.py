"""What any C++ component may ask: time, sleep, costs, words, its parameters and its required ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from volery.base.errors import UsageError, choices, did_you_mean
from volery.base.position import AMSL, Position
from volery.base.time import Ns
from volery.components import component_api
from volery.components.cpp.bindings import CppOperation
from volery.components.cpp.framework import ProcessExit
from volery.components.virtual_stdlib import EPOCH
from volery.kernel import waiting
from volery.kernel.api import Kernel
from volery.ros.client_libraries.abi_codec import CppFlow, Reader, RequestHandler, Writer
from volery.vehicles import Drone

STICK_FULL_SCALE = 1000
"""Full deflection of a stick in the calls of ``I_RosDron``."""


@dataclass(frozen=True)
class ConnectedPort:
    """A required port's operations by name, and what it is connected to. Operations are empty for drones."""

    operations: Mapping[str, CppOperation]
    targets: Sequence[Any]


def request_handlers(
    kernel: Kernel, name: str, parameters: Mapping[str, Any], ports: Mapping[str, ConnectedPort]
) -> dict[str, RequestHandler]:
    """What the component called *name* is answered. *ports* may be filled until it first asks."""
    return {**_services(kernel), **_ports(name, ports), "parameter": _Parameters(name, parameters)}


def _services(kernel: Kernel) -> dict[str, RequestHandler]:
    def now(flow: CppFlow, asked: Reader) -> bytes:
        return Writer().real(component_api.now()).done()

    def monotonic(flow: CppFlow, asked: Reader) -> bytes:
        with kernel:
            return Writer().integer(kernel.now()).done()

    def time_of_day(flow: CppFlow, asked: Reader) -> bytes:
        with kernel:
            return Writer().integer(EPOCH + kernel.now()).done()

    def sleep(flow: CppFlow, asked: Reader) -> bytes:
        component_api.sleep(asked.real())
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
    component_api.add_time(seconds, at_mhz or None, joules)
    return b""


def _log(flow: CppFlow, asked: Reader) -> bytes:
    component_api.log(asked.text(), asked.text())
    return b""


def _note(flow: CppFlow, asked: Reader) -> bytes:
    component_api.note(asked.text(), asked.text(), asked.text(), asked.text())
    return b""


def _exit(flow: CppFlow, asked: Reader) -> bytes:
    raise ProcessExit(asked.integer())


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


def _ports(name: str, ports: Mapping[str, ConnectedPort]) -> dict[str, RequestHandler]:
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


def _drone(name: str, ports: Mapping[str, ConnectedPort], port: str, index: int) -> Drone:
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
    pitch, roll, throttle, yaw = (asked.integer() / STICK_FULL_SCALE for _ in range(4))
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
