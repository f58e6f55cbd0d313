"""The effects of faults on a simulated run. The kinds of faults are declared in ``volery.model.faults``.

Every effect is one function that makes a fault happen or ends it. Scenarios of a model and fault trials use
the same functions; they differ in how the link to an autopilot is reached (``LinkControl``).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from math import nan, radians
from typing import Any, Protocol

import numpy as np

from volery.base.elementary import cos, sin
from volery.base.errors import CapabilityError, ModelError
from volery.base.time import Ns
from volery.kernel.api import Handle, Kernel
from volery.kernel.network import Network
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.links.wire_faults import WireFaults
from volery.model.environment import Environment, WindSpec
from volery.model.faults import (
    AddedSensorFault,
    BarometerStuck,
    BatteryCellDead,
    BatteryLow,
    CameraBlack,
    CompassStuck,
    CompassTurned,
    ComputerSlowed,
    ComputerStopped,
    Fault,
    GpsDrift,
    GpsLost,
    ImuBiased,
    ImuNoisy,
    LinkCut,
    LinkDegraded,
    MotorDead,
    NetworkCut,
    NetworkDegraded,
    NetworkFault,
    ProcessorFault,
    RangesMaximum,
    RangesNotANumber,
    RcLost,
    SensorClockOff,
    SensorSilent,
    SensorStuck,
    VehicleFault,
    WindChange,
)
from volery.run.assembly.computers import LOAD_PERIOD, LOAD_PRIORITY, load_name
from volery.run.assembly.sensor_node import Alteration
from volery.run.assembly.simulated_fleet import SimulatedFleet, wind_of
from volery.simulation.added_sensors.beams import BeamSensor
from volery.simulation.autopilots.autopilot import Autopilot
from volery.simulation.autopilots.fleet_autopilot import firmwares
from volery.simulation.real_firmware.lock_step import RealFirmware
from volery.simulation.real_firmware.outside_program import OutsideProgram
from volery.simulation.world.sensors import Measurement, SampledSensor
from volery.trace.events import WARNING, Text

ALWAYS: tuple[tuple[Ns, Ns], ...] = ((0, 1 << 62),)
NO_WIRE_FAULTS = WireFaults()


class LinkControl(Protocol):
    """Control of the links to autopilots."""

    def cut(self, vehicle: str, active: bool) -> None:
        """Let nothing pass on the link of *vehicle*, in either direction; or let it pass again."""

    def set_faults(self, vehicle: str, faults: WireFaults) -> None:
        """Apply *faults* to whatever passes on the link of *vehicle* from now on."""


@dataclass
class FleetLinks:
    """Control of the links that a fleet has made for a model."""

    fleet: SimulatedFleet
    _cut: set[str] = field(default_factory=set)
    _faults: dict[str, WireFaults] = field(default_factory=dict)

    def cut(self, vehicle: str, active: bool) -> None:
        """See ``LinkControl``."""
        if active:
            self._cut.add(vehicle)
        else:
            self._cut.discard(vehicle)
        self.set_faults(vehicle, self._faults.get(vehicle, NO_WIRE_FAULTS))

    def set_faults(self, vehicle: str, faults: WireFaults) -> None:
        """See ``LinkControl``. A link that is cut stays cut."""
        self._faults[vehicle] = faults
        for link in self.fleet.faulty_links(vehicle):
            link.set_faults(replace(faults, cuts=ALWAYS) if vehicle in self._cut else faults)


@dataclass
class Affected:
    """The parts of a run that faults act on.

    ``wind`` is the one that returns when a fault of it is over. ``loads`` and ``degraded`` are the loads of
    computers and the loss and delay of networks that faults cause at present, by fault.
    """

    kernel: Kernel
    fleet: SimulatedFleet
    links: LinkControl
    wind: WindSpec = field(default_factory=WindSpec)
    processors: Mapping[str, Processor] = field(default_factory=dict)
    networks: Mapping[str, Network] = field(default_factory=dict)
    loads: dict[str, list[Handle]] = field(default_factory=dict)
    degraded: dict[str, dict[str, tuple[float, Ns]]] = field(default_factory=dict)


def with_faulty_links(environment: Environment) -> frozenset[str]:
    """Return the vehicles whose links must go through bytes, because a fault damages them.

    Raises:
        ModelError: a vehicle has no link that a fault could damage.
    """
    found = set()
    autopilots = {vehicle.name: vehicle.autopilot for vehicle in environment.vehicles}
    for fault in environment.faults:
        if isinstance(fault, LinkCut | LinkDegraded):
            firmware = firmwares.load(autopilots[fault.vehicle])
            if firmware.codec is None:
                what = f"a simulated {firmware.name} has no link; {fault.vehicle} is reached over a graph"
                raise ModelError(what, f"environment.faults.{fault.name}.vehicle", fault.where)
            found.add(fault.vehicle)
    return frozenset(found)


def inject(faults: Iterable[Fault], affected: Affected) -> None:
    """Schedule every fault and its end, both of which are recorded in the trace.

    Raises:
        CapabilityError: this run does not model what a fault happens to, or a program of real firmware cannot
            be given it.
    """
    kernel = affected.kernel
    for fault in faults:
        if (isinstance(fault, ProcessorFault) and fault.subject not in affected.processors) or (
            isinstance(fault, NetworkFault) and fault.subject not in affected.networks
        ):
            raise CapabilityError(
                f"fault {fault.name}: {fault.subject} is not modelled in this run; "
                "faults of computers and networks need the embedded graph"
            )
        if isinstance(fault, VehicleFault):
            autopilot = affected.fleet.autopilots[fault.vehicle]
            if isinstance(autopilot, RealFirmware | OutsideProgram):
                autopilot.require(fault.kind, fault.name)
            elif (
                isinstance(fault, RcLost)
                and isinstance(autopilot, Autopilot)
                and not autopilot.vehicle.rules.rc.can_be_lost
            ):
                raise CapabilityError(
                    f"fault {fault.name}: the simulated {autopilot.firmware.name} of {fault.vehicle} does "
                    "without a transmitter; leave it out, or fly that vehicle on real firmware"
                )
        kernel.call_at(fault.at_ns, partial(_happen, fault, affected, True))
        if fault.duration_ns is not None:
            kernel.call_at(fault.at_ns + fault.duration_ns, partial(_happen, fault, affected, False))


def _happen(fault: Fault, affected: Affected, active: bool) -> None:
    kernel = affected.kernel
    text = f"fault {fault.name}: {fault.kind}" if active else f"fault {fault.name} is over"
    kernel.record(Text(kernel.now(), fault.subject, WARNING, text))
    apply_fault(fault, affected, active)


def apply_fault(fault: Fault, affected: Affected, active: bool = True) -> None:
    """Make *fault* happen now, or end it."""
    EFFECTS[type(fault)](fault, affected, active)


# -- the effects


def _flight_effect(act: Callable[[Any, Any, bool], None]) -> Callable[[Any, Affected, bool], None]:
    """Return the effect of a fault that acts on the flight of its vehicle."""

    def effect(fault: VehicleFault, affected: Affected, active: bool) -> None:
        act(affected.fleet.flights[fault.vehicle], fault, active)

    return effect


def _drift(flight: Any, fault: GpsDrift, active: bool) -> None:
    speed, direction = (fault.speed_m_s if active else 0.0), radians(fault.direction_deg)
    flight.drift_gps(speed * cos(direction), speed * sin(direction))


def _turn_compass(flight: Any, fault: CompassTurned, active: bool) -> None:
    flight.turn_compass(radians(fault.turn_deg) if active else 0.0)


def _inertial(act: Callable[[Any], Callable[[float, float], None]]) -> Callable[[Any, Affected, bool], None]:
    """Return the effect of a fault of gyroscope and accelerometer."""

    def effect(flight: Any, fault: ImuBiased | ImuNoisy, active: bool) -> None:
        share = 1.0 if active else 0.0
        act(flight)(share * radians(fault.gyro_deg_s), share * fault.accel_m_s2)

    return _flight_effect(effect)


def _drain(flight: Any, fault: BatteryLow, active: bool) -> None:
    if active:
        flight.set_charge(fault.charge)


def _sensor_effect(
    alteration: Callable[[Any, SampledSensor | None], Alteration],
) -> Callable[[Any, Affected, bool], None]:
    """Return the effect of a fault that alters the samples of an added sensor on their way to the graph."""

    def effect(fault: AddedSensorFault, affected: Affected, active: bool) -> None:
        present = affected.fleet.alterations[fault.vehicle].setdefault(fault.sensor, {})
        present.pop(fault.name, None)
        if active:
            mounted = affected.fleet.flights[fault.vehicle].added_sensors()
            sensor = next((one for one in mounted if one.name == fault.sensor), None)
            present[fault.name] = alteration(fault, sensor)

    return effect


def _repeat(fault: SensorStuck, sensor: SampledSensor | None) -> Alteration:
    first: list[Measurement] = []

    def repeated(sample: Measurement) -> Measurement:
        first.append(sample)
        del first[1:]
        return Measurement(sample.time, first[0].values)

    return repeated


def _read_everywhere(value: float | None) -> Callable[[Any, SampledSensor | None], Alteration]:
    """Return what makes each beam read a distance [m], or the longest one if it is None."""

    def alteration(fault: AddedSensorFault, sensor: SampledSensor | None) -> Alteration:
        assert isinstance(sensor, BeamSensor), "the model's reader checks it"
        distance = sensor.ranging.most if value is None else value
        return lambda sample: Measurement(sample.time, np.full(np.shape(sample.values), distance))

    return alteration


def _cut_link(fault: LinkCut, affected: Affected, active: bool) -> None:
    affected.links.cut(fault.vehicle, active)


def _degrade_link(fault: LinkDegraded, affected: Affected, active: bool) -> None:
    faults = WireFaults(
        drop=fault.loss,
        flip=fault.corrupt,
        truncate=fault.truncate,
        duplicate=fault.duplicate,
        reorder=fault.reorder,
        jitter=fault.delay_ns,
    )
    affected.links.set_faults(fault.vehicle, faults if active else NO_WIRE_FAULTS)


def _degrade_network(fault: NetworkCut | NetworkDegraded, affected: Affected, active: bool) -> None:
    """Apply the greatest loss and the sum of the delays of all faults of a network at present."""
    present = affected.degraded.setdefault(fault.network, {})
    present.pop(fault.name, None)
    if active:
        present[fault.name] = (1.0, 0) if isinstance(fault, NetworkCut) else (fault.loss, fault.delay_ns)
    losses, delays = [loss for loss, _ in present.values()], [delay for _, delay in present.values()]
    affected.networks[fault.network].degrade(loss=max(losses, default=0.0), delay=sum(delays))


def _stop_computer(fault: ComputerStopped, affected: Affected, active: bool) -> None:
    processor = affected.processors[fault.processor]
    if active:
        processor.halt()
    else:
        processor.resume()


def _slow_computer(fault: ComputerSlowed, affected: Affected, active: bool) -> None:
    """Add background load: on each core the same share of every period."""
    for handle in affected.loads.pop(fault.name, ()):
        handle.cancel()
    if active:
        processor, piece = affected.processors[fault.processor], round(fault.load * LOAD_PERIOD)
        affected.loads[fault.name] = [
            affected.kernel.every(
                LOAD_PERIOD,
                partial(
                    processor.load,
                    ExecutionContext(load_name(processor.name), processor, LOAD_PRIORITY, deadline=0),
                    piece,
                ),
            )
            for _ in range(processor.cores)
        ]


def _change_wind(fault: WindChange, affected: Affected, active: bool) -> None:
    wind = WindSpec(fault.speed_m_s, fault.direction_deg, fault.gusts_m_s) if active else affected.wind
    if affected.fleet.flights:  # a model of computers alone has no world
        affected.fleet.world.set_wind(wind_of(wind))


EFFECTS: Mapping[type[Fault], Callable[[Any, Affected, bool], None]] = {
    MotorDead: _flight_effect(
        lambda flight, fault, active: flight.weaken_motor(fault.motor - 1, fault.thrust if active else 1.0)
    ),
    BatteryLow: _flight_effect(_drain),
    BatteryCellDead: _flight_effect(
        lambda flight, fault, active: flight.short_cells(fault.cells if active else 0)
    ),
    GpsLost: _flight_effect(lambda flight, fault, active: flight.block_gps(active)),
    GpsDrift: _flight_effect(_drift),
    BarometerStuck: _flight_effect(lambda flight, fault, active: flight.block_barometer(active)),
    CompassStuck: _flight_effect(lambda flight, fault, active: flight.block_compass(active)),
    CompassTurned: _flight_effect(_turn_compass),
    ImuBiased: _inertial(lambda flight: flight.bias_inertial),
    ImuNoisy: _inertial(lambda flight: flight.shake_inertial),
    RcLost: _flight_effect(lambda flight, fault, active: flight.block_transmitter(active)),
    SensorSilent: _sensor_effect(lambda fault, sensor: lambda sample: None),
    SensorStuck: _sensor_effect(_repeat),
    SensorClockOff: _sensor_effect(
        lambda fault, sensor: lambda sample: Measurement(sample.time + fault.by_ns, sample.values)
    ),
    CameraBlack: _sensor_effect(
        lambda fault, sensor: lambda sample: Measurement(sample.time, sample.values._replace(lux=0.0))
    ),
    RangesMaximum: _sensor_effect(_read_everywhere(None)),
    RangesNotANumber: _sensor_effect(_read_everywhere(nan)),
    LinkCut: _cut_link,
    LinkDegraded: _degrade_link,
    NetworkCut: _degrade_network,
    NetworkDegraded: _degrade_network,
    ComputerStopped: _stop_computer,
    ComputerSlowed: _slow_computer,
    WindChange: _change_wind,
}
"""The effect of each kind of fault that a model can state."""
