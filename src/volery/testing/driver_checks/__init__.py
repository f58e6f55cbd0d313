"""Conformance checks of drivers, one module per group; importing a module registers its checks."""

from volery.testing.checks import group_of
from volery.testing.driver_checks import (
    flight_checks,
    ground_checks,
    link_checks,
    manual_control_checks,
    mission_checks,
    other_station_checks,
    rover_checks,
)

GROUPS = tuple(
    group_of(module.__name__)
    for module in (
        ground_checks,
        flight_checks,
        manual_control_checks,
        mission_checks,
        other_station_checks,
        link_checks,
        rover_checks,
    )
)
"""Groups in the order of execution, from harmless to risky."""
