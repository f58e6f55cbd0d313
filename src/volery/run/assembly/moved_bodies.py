"""Bodies that an FMU moves: checked before a run, and started for it."""

from __future__ import annotations

from pathlib import Path

from volery.model.environment import VehicleSpec
from volery.run.assembly.bodies import body_of
from volery.simulation.fmu.fmu_body import FmuBody
from volery.simulation.fmu.fmu_interface import INPUTS, read_interface
from volery.simulation.fmu.running_fmu import RunningFmu
from volery.simulation.world.body_specs import Multirotor


def check_body(vehicle: VehicleSpec) -> None:
    """Check that the FMU of a vehicle, if it has one, can move it on this machine.

    Raises:
        UsageError: It cannot. The text does not name the vehicle.
    """
    if vehicle.body is not None:
        body = body_of(vehicle)
        assert isinstance(body, Multirotor)
        read_interface(vehicle.body, len(body.rotors))


def start_body(vehicle: VehicleSpec, folder: Path) -> FmuBody:
    """Start the FMU that a vehicle has, in a folder below *folder*.

    Raises:
        UsageError: It cannot move the vehicle.
        FirmwareError: It cannot be started.
    """
    assert vehicle.body is not None
    body = body_of(vehicle)
    assert isinstance(body, Multirotor)
    interface = read_interface(vehicle.body, len(body.rotors))
    fmu = RunningFmu(vehicle.name, interface, folder / vehicle.name)
    try:
        return FmuBody(fmu, body, vehicle.body.axes)
    except BaseException:
        fmu.close()
        raise


def remark_on_body(vehicle: str, body: FmuBody) -> str:
    """Return which FMU moved a vehicle, and what of the world did not act on it."""
    interface = body.fmu.interface
    absent = sorted(name for name in INPUTS if name not in interface.inputs.widths)
    without = f"; it does not take {', '.join(absent)}" if absent else ""
    return f"{vehicle}: moved by {interface.file.name} (FMI {interface.version}){without}"
