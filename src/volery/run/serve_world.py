"""``serve_world``: the world of a model for programs of others, which fly its vehicles over ArduPilot's JSON.

Virtual time passes as the programs ask: it stands still while one of them has not asked for its next samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from volery.base.errors import UsageError, choices
from volery.base.time import Ns
from volery.model.environment import VehicleSpec
from volery.model.system import System
from volery.run.assembly.simulated_fleet import OutsideAutopilot
from volery.run.result import Options, Tell
from volery.run.run_session import NO_LIMIT, RunSession
from volery.simulation.autopilots.flight_stack.flight import Flight
from volery.simulation.real_firmware.ardupilot import (
    airframe_parameters,
    defaults_text,
    exchange_period,
    home_option,
    period_of,
)
from volery.simulation.real_firmware.outside_program import OutsideProgram, QuestionPort

USUAL_PORT = 9002
"""Where ArduPilot asks."""
STRIDE = 10
"""Ports between those of two instances of ArduPilot."""
RATES = 20.0, 4000.0
"""Least and greatest rate of exchanges [Hz]."""


class WorldPorts(NamedTuple):
    """Where programs ask.

    Attributes:
        host: Address of this computer.
        first: UDP port of the first vehicle; each further one is ``STRIDE`` above.
        rate: Exchanges per simulated second; None: two for each loop of ArduPilot at its usual rate.
        only: The one vehicle that is served; empty: all.
    """

    host: str = "127.0.0.1"
    first: int = USUAL_PORT
    rate: float | None = None
    only: str = ""


class ServedVehicle(NamedTuple):
    """A vehicle that a program is to fly.

    Attributes:
        name: The vehicle.
        address: Where its program asks.
        command: An ArduPilot that fits.
    """

    name: str
    address: str
    command: str


def bare_world(system: System, duration: Ns | None) -> System:
    """Return a model without what needs components: vehicles and computers, which idle, stay."""
    vehicles = tuple(replace(vehicle, processor=None, firmware=None) for vehicle in system.vehicles)
    return replace(
        system,
        instances=(),
        chains=(),
        requirements=(),
        environment=replace(system.environment, vehicles=vehicles),
        limits=replace(system.limits, duration_ns=duration or NO_LIMIT, until=None),
    )


class WorldSession(RunSession):
    """A run whose vehicles are flown by programs of others. Its components do not run.

    Args:
        system: The model.
        options: Options of the run.
        ports: Where programs ask.
        duration: Simulated time after which it ends; None: it goes on.
        tell: Receives a line when a program begins, is silent or is not understood.

    Raises:
        UsageError: There is no vehicle, a rate is out of range, or a port cannot be opened.
    """

    def __init__(
        self, system: System, options: Options, ports: WorldPorts, duration: Ns | None, tell: Tell
    ) -> None:
        self._ports, self._report = ports, tell
        names = [vehicle.name for vehicle in system.vehicles]
        if not names:
            raise UsageError(f"{system.name} has no vehicle; add one below environment.vehicles of the model")
        if ports.only and ports.only not in names:
            raise UsageError(f"{system.name} has no vehicle {ports.only!r}; there is {choices(names)}")
        if ports.rate is not None and not RATES[0] <= ports.rate <= RATES[1]:
            raise UsageError(f"a rate of {ports.rate:g} Hz: give {RATES[0]:g} to {RATES[1]:g}")
        self._addresses: dict[str, str] = {}
        super().__init__(bare_world(system, duration), options)
        self._ending.status_by_signal = "completed"
        self.served = tuple(self._served(place, name) for place, name in enumerate(self._addresses))
        """The vehicles that programs fly."""

    def _outside(self) -> Mapping[str, OutsideAutopilot]:
        wanted = [vehicle for vehicle in self._system.vehicles if self._ports.only in ("", vehicle.name)]
        return {one.name: self._open(place, one) for place, one in enumerate(wanted)}

    def _open(self, instance: int, vehicle: VehicleSpec) -> OutsideAutopilot:
        host, rate = self._ports.host, self._ports.rate
        number = self._ports.first + STRIDE * instance
        port = QuestionPort(vehicle.name, host, number, self._report, lambda: self._ending.signalled)
        self._opened.callback(port.close)
        self._addresses[vehicle.name] = port.address
        period = exchange_period(vehicle.kind, {}) if rate is None else period_of(rate)
        return partial(self._attended, vehicle.name, port, period)

    def _attended(self, name: str, port: QuestionPort, period: Ns, flight: Flight) -> OutsideProgram:
        return OutsideProgram(self._kernel, flight, name, port, period)

    def _served(self, instance: int, name: str) -> ServedVehicle:
        vehicle, flight = self._system.vehicle(name), self._fleet.flights[name]
        program = "arducopter" if flight.flying else "ardurover"
        words = [f"{program} --model=JSON:{self._ports.host} -I{instance}", home_option(flight)]
        if self._ports.first != USUAL_PORT:
            words.append(f"--sim-port-out={self._ports.first + STRIDE * instance}")
        if self._options.folder is not None:
            own = vehicle.parameters if vehicle.autopilot == "ardupilot" else {}
            file = self._options.folder / f"{name}.parm"
            file.write_text(defaults_text(airframe_parameters(flight.spec) | dict(own)), "ascii")
            words.append(f"--defaults={file}")
        return ServedVehicle(name, self._addresses[name], " ".join(words))
