"""volery: model a drone-and-rover service once, simulate it, fly it, and learn what it costs the computers.

The names that most programs need are imported when they are first used, so that ``import volery`` is light.
They are listed once, in the imports below, which type checkers and editors read. At run time the same lines
are read from this file, because a second list would have to be kept in agreement with them.
"""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.base.errors import CapabilityError as CapabilityError
    from volery.base.errors import ComponentError as ComponentError
    from volery.base.errors import ControlLost as ControlLost
    from volery.base.errors import CriticalBattery as CriticalBattery
    from volery.base.errors import Deadlock as Deadlock
    from volery.base.errors import EstimateError as EstimateError
    from volery.base.errors import Failsafe as Failsafe
    from volery.base.errors import FleetError as FleetError
    from volery.base.errors import LinkError as LinkError
    from volery.base.errors import LinkGarbled as LinkGarbled
    from volery.base.errors import LinkLost as LinkLost
    from volery.base.errors import LinkSilent as LinkSilent
    from volery.base.errors import LowBattery as LowBattery
    from volery.base.errors import ModelError as ModelError
    from volery.base.errors import NotArrived as NotArrived
    from volery.base.errors import ObstacleNear as ObstacleNear
    from volery.base.errors import OffTrack as OffTrack
    from volery.base.errors import OutOfBounds as OutOfBounds
    from volery.base.errors import Overridden as Overridden
    from volery.base.errors import PositionLost as PositionLost
    from volery.base.errors import Refused as Refused
    from volery.base.errors import ThrustSaturated as ThrustSaturated
    from volery.base.errors import UsageError as UsageError
    from volery.base.errors import VehicleError as VehicleError
    from volery.base.errors import VoleryError as VoleryError
    from volery.base.position import AMSL as AMSL
    from volery.base.position import AboveGround as AboveGround
    from volery.base.position import AboveHome as AboveHome
    from volery.base.position import Ellipsoidal as Ellipsoidal
    from volery.base.position import Position as Position
    from volery.components.component_api import add_time as add_time
    from volery.components.component_api import log as log
    from volery.components.component_api import node as node
    from volery.components.component_api import note as note
    from volery.components.component_api import now as now
    from volery.components.component_api import sleep as sleep
    from volery.explore.campaign import Campaign as Campaign
    from volery.explore.campaign import explore as explore
    from volery.model.builder import ModelBuilder as ModelBuilder
    from volery.run.asynchronous import connect_async as connect_async
    from volery.run.connect import attach as attach
    from volery.run.connect import connect as connect
    from volery.run.connect import connect_fleet as connect_fleet
    from volery.run.fly import fly as fly
    from volery.run.process_session import ProcessRunSession as ProcessRunSession
    from volery.run.result import Options as Options
    from volery.run.result import Run as Run
    from volery.run.run_session import RunSession as RunSession
    from volery.run.simulate import simulate as simulate
    from volery.vehicles import Drone as Drone
    from volery.vehicles import Escalation as Escalation
    from volery.vehicles import Fence as Fence
    from volery.vehicles import Fleet as Fleet
    from volery.vehicles import Limits as Limits
    from volery.vehicles import Reaction as Reaction
    from volery.vehicles import Rover as Rover
    from volery.vehicles import Zone as Zone
    from volery.vehicles.vehicle_plan import Plan as Plan


def _public_names() -> dict[str, str]:
    """Return the module of each public name, from the imports above."""
    source = Path(__file__).with_suffix(".py").read_text(encoding="utf-8")
    found = re.findall(r"^    from (volery\.\S+) import (\w+) as \2$", source, re.MULTILINE)
    return {name: module for module, name in found}


def __getattr__(name: str) -> Any:
    if name == "__all__":
        value: Any = sorted(_public_names())
    elif not name.startswith("_") and (module := _public_names().get(name)):
        value = getattr(import_module(module), name)
    else:
        raise AttributeError(f"module 'volery' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_public_names()})
