"""The faults of fault trials, by name: kinds of the catalogue (``volery.model.faults``) with arguments.

The effects are those of a model's faults. Only here are the two kinds that a model cannot state: another
station that takes over, and the death of the program.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from volery.base.time import from_seconds, to_seconds
from volery.links.wire_faults import WireFaults
from volery.model.faults import (
    BatteryLow,
    Fault,
    GpsLost,
    LinkCut,
    LinkDegraded,
    OtherStation,
    ProgramKilled,
    VehicleFault,
    WindChange,
)
from volery.run.assembly.fault_effects import Affected, apply_fault
from volery.testing.simulated_stage import SimulatedStage

F = TypeVar("F", bound=Fault)


def _trial(kind: type[F], seconds: float | None = None, **arguments: Any) -> F:
    """Return a fault that happens when the trial is ready for it, to the vehicle of the trial."""
    if issubclass(kind, VehicleFault):
        arguments["vehicle"] = ""
    return kind(at_ns=0, duration_ns=None if seconds is None else from_seconds(seconds), **arguments)


FAULTS: Mapping[str, Fault | None] = {
    "none": None,
    "cut-0.5": _trial(LinkCut, 0.5),
    "cut-2": _trial(LinkCut, 2.0),
    "cut-10": _trial(LinkCut, 10.0),
    "duplicated": _trial(LinkDegraded, duplicate=1.0),
    "reordered": _trial(LinkDegraded, reorder=0.3),
    "corrupted": _trial(LinkDegraded, corrupt=0.01),
    "truncated": _trial(LinkDegraded, truncate=0.2),
    "other-station": _trial(OtherStation),
    "killed": _trial(ProgramKilled),
    "battery-low": _trial(BatteryLow, charge=0.08),
    "gps-lost": _trial(GpsLost),
    "wind": _trial(WindChange, speed_m_s=12.0, direction_deg=270.0, gusts_m_s=1.5),
}
"""12 m/s is the strongest wind against which this airframe still makes way: at 30 degrees of tilt its drag
holds 13 m/s.
"""


@dataclass
class _StageLinks:
    """Control of the link of the program under test."""

    stage: SimulatedStage

    def cut(self, vehicle: str, active: bool) -> None:
        """See ``volery.run.assembly.fault_effects.LinkControl``."""
        if active:
            self.stage.link_control.drop()
        else:
            self.stage.link_control.restore()

    def set_faults(self, vehicle: str, faults: WireFaults) -> None:
        """See ``volery.run.assembly.fault_effects.LinkControl``."""
        self.stage.set_faults(faults)


def strike(fault: Fault | None, stage: SimulatedStage) -> None:
    """Make a fault of a trial happen now, to the vehicle of *stage*; it ends after its duration, if any."""
    if fault is None:
        return
    if isinstance(fault, ProgramKilled):  # as a killed process: the link is silent
        stage.link_control.drop()
        return
    if isinstance(fault, OtherStation):
        other = stage.other()
        if stage.driver.telemetry.flying:
            other.land()
        else:
            other.disarm()
        return
    if isinstance(fault, VehicleFault):
        fault = replace(fault, vehicle=stage.name_of_vehicle)
    affected = Affected(stage.kernel, stage.fleet, _StageLinks(stage))
    apply_fault(fault, affected)
    if fault.duration_ns is not None:
        ending = fault
        stage.later(to_seconds(fault.duration_ns), lambda: apply_fault(ending, affected, active=False))
