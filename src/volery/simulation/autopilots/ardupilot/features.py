"""The features of the simulated ArduPilot in the order of their effects, and which of them are on by default.

By default are those on that back an operation of volery, an arming check or a failsafe, and those that
perception feeds. The others cost nothing unless ``sim:ardupilot?features=all`` or their names ask for them:
their modules are not imported, and the firmware does not have their parameters, commands and modes.
"""

from __future__ import annotations

from collections.abc import Collection
from importlib import import_module
from typing import NamedTuple

from volery.simulation.autopilots.ardupilot.feature import Feature


class ListedFeature(NamedTuple):
    """A feature: the name of its module, and beginnings of the names of parameters that only it has."""

    name: str
    by_default: bool
    prefixes: tuple[str, ...] = ()


ON, OFF = True, False

ORDER = (
    ListedFeature("follow", OFF, ("FOLL_",)),
    ListedFeature("buttons", OFF, ("BTN_",)),
    ListedFeature("servo_outputs", ON),
    ListedFeature("payload", ON),
    ListedFeature("sprayer", OFF, ("SPRAY_",)),
    ListedFeature("camera", ON),
    ListedFeature("mount_control", ON),
    ListedFeature("winch", OFF, ("WINCH_",)),
    ListedFeature("landing_gear", OFF, ("LGR_",)),
    ListedFeature("landing_sequence", OFF),
    ListedFeature("rally", ON),
    ListedFeature("fence", ON),
    ListedFeature("estimator_sources", ON),
    ListedFeature("external_navigation", ON),
    ListedFeature("proximity", ON),
    ListedFeature("precision_landing", ON),
    ListedFeature("range_finder", ON),
    ListedFeature("traffic", OFF, ("ADSB_", "AVD_")),
    ListedFeature("auxiliary", ON),
    ListedFeature("takeoff_check", ON),
    ListedFeature("weathervane", OFF, ("WVANE_",)),
    ListedFeature("motor_test", OFF),
    ListedFeature("crash_check", ON),
    ListedFeature("parameter_checks", ON),
    ListedFeature("avoidance", ON),
    ListedFeature("airspeed", OFF, ("ARSPD",)),
    ListedFeature("flip", OFF),
    ListedFeature("throw", OFF, ("THROW_",)),
    ListedFeature("guided_items", OFF),
    ListedFeature("payload_place", OFF, ("PLDP_",)),
    ListedFeature("high_latency", OFF),
)
"""Tables are merged and set-points limited in this order, and it is that of the work at each tick."""

OPTIONAL = tuple(entry.name for entry in ORDER if not entry.by_default)
"""Features that are off by default."""


def features_of(kind: str, optional: Collection[str]) -> dict[str, Feature]:
    """Return the features of a kind of vehicle by name: those on by default, and some of the others.

    Args:
        kind: ``COPTER`` or ``ROVER``.
        optional: Names of ``OPTIONAL``.
    """
    names = [entry.name for entry in ORDER if entry.by_default or entry.name in optional]
    modules = {name: import_module(f"{__package__}.{name}") for name in names}
    return {name: getattr(module, kind) for name, module in modules.items() if hasattr(module, kind)}


def absent(parameter: str, optional: Collection[str]) -> str:
    """Return the feature that alone has a parameter, if it is off; else an empty text."""
    off = (entry for entry in ORDER if not entry.by_default and entry.name not in optional)
    return next((entry.name for entry in off if parameter.startswith(entry.prefixes)), "")
