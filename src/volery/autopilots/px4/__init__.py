"""PX4 1.14.0, multirotor and rover, as a dialect of the simulated flight stack: as recorded, not as we think
it is.
"""

from volery.autopilots.px4.copter import COPTER
from volery.autopilots.simulated.dialect import Family

DIALECT = Family("px4", {"multirotor": COPTER})
"""The firmware, by kind of vehicle."""

__all__ = ["DIALECT"]
