"""volery: model a drone-and-rover service once, simulate it, fly it, know what it costs the computers.

What most programs need is here, imported when it is first used: ``import volery`` itself costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.base.errors import VoleryError
    from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position
    from volery.components.component_api import add_time, log, note, now, sleep
    from volery.run.connect import connect, connect_fleet
    from volery.run.fly import fly
    from volery.run.result import Options, Run
    from volery.run.simulate import simulate
    from volery.vehicles import Drone, Fence, Fleet, Limits, Rover, Zone

_HOME_OF = {
    "AMSL": "base.position",
    "AboveGround": "base.position",
    "AboveHome": "base.position",
    "Drone": "vehicles",
    "Ellipsoidal": "base.position",
    "Fence": "vehicles",
    "Fleet": "vehicles",
    "Limits": "vehicles",
    "Options": "run.options",
    "Position": "base.position",
    "Rover": "vehicles",
    "Run": "run.result",
    "VoleryError": "base.errors",
    "Zone": "vehicles",
    "add_time": "components.services",
    "connect": "run.connect",
    "connect_fleet": "run.connect",
    "fly": "run.fly",
    "log": "components.services",
    "note": "components.services",
    "now": "components.services",
    "simulate": "run.simulate",
    "sleep": "components.services",
}

__all__ = [
    "AMSL",
    "AboveGround",
    "AboveHome",
    "Drone",
    "Ellipsoidal",
    "Fence",
    "Fleet",
    "Limits",
    "Options",
    "Position",
    "Rover",
    "Run",
    "VoleryError",
    "Zone",
    "add_time",
    "connect",
    "connect_fleet",
    "fly",
    "log",
    "note",
    "now",
    "simulate",
    "sleep",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'volery' has no attribute {name!r}")
    thing = getattr(import_module(f"volery.{_HOME_OF[name]}"), name)
    globals()[name] = thing
    return thing


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
