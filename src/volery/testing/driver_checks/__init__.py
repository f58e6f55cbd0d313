"""The checks themselves, one module for each group; importing them registers them."""

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
"""In the order in which they are run: from harmless to daring."""
