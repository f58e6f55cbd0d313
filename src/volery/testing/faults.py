"""What goes wrong in a fault trial: of the wire, with other people, with the aircraft, in the air."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from volery.links.wire_faults import WireFaults
from volery.simulation.world.environment_models import Wind
from volery.testing.simulated_stage import SimulatedStage

NO_WIRE_FAULTS = WireFaults()

GALE = Wind(east=12.0, gust=1.5)
"""The strongest in which this airframe still goes against it: at 30 degrees of tilt its drag holds 13 m/s."""


@dataclass(frozen=True)
class Fault:
    """``begins`` makes it happen. ``deadly``: it ends the program. ``brings_down``: somebody else commands
    the vehicle from then on; our program must not.
    """

    words: str
    begins: Callable[[SimulatedStage], None]
    deadly: bool = False
    brings_down: bool = False


def _cut(seconds: float) -> Callable[[SimulatedStage], None]:
    def begins(stage: SimulatedStage) -> None:
        stage.tap.cut()
        stage.later(seconds, stage.tap.mend)

    return begins


def _suffers(faults: WireFaults) -> Callable[[SimulatedStage], None]:
    return lambda stage: stage.set_faults(faults)


def _another_station(stage: SimulatedStage) -> None:
    other = stage.other()
    if stage.driver.telemetry.flying:
        other.lands_it()
    else:
        other.disarms_it()


def _dies(stage: SimulatedStage) -> None:
    """As a killed process: no farewell, the link is silent."""
    stage.tap.cut()


FAULTS: Mapping[str, Fault] = {
    "none": Fault("nothing goes wrong", lambda stage: None),
    "cut-0.5": Fault("the link is cut for 0.5 s", _cut(0.5)),
    "cut-2": Fault("the link is cut for 2 s", _cut(2.0)),
    "cut-10": Fault("the link is cut for 10 s", _cut(10.0)),
    "duplicated": Fault("from then on each frame arrives twice", _suffers(WireFaults(duplicate=1.0))),
    "reordered": Fault("from then on 30 % of the frames are overtaken", _suffers(WireFaults(reorder=0.3))),
    "corrupted": Fault("from then on 1 % of the bytes have a bit turned", _suffers(WireFaults(flip=0.01))),
    "truncated": Fault("from then on 20 % of the frames end too early", _suffers(WireFaults(truncate=0.2))),
    "other-station": Fault(
        "another station lands it (on the ground: disarms it); where programs share a node, the pilot does",
        _another_station,
        brings_down=True,
    ),
    "killed": Fault("the program is killed", _dies, deadly=True),
    "battery-low": Fault("8 % are left in the battery", lambda stage: stage.flight.drain_battery(0.08)),
    "gps-lost": Fault("no satellites are seen any more", lambda stage: stage.flight.block_gps()),
    "wind": Fault("wind of 12 m/s from the west, with gusts", lambda stage: stage.fleet.world.set_wind(GALE)),
}
