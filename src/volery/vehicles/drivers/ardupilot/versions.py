"""What ArduPilot's messages and parameters mean, by version.

The rules were read in the sources of Copter-4.5.0 to Copter-4.6.3 and of 4.8.0-dev (64a9c7877b, 21 March
2026), which has all of 4.7.
"""

from __future__ import annotations

from volery.vehicles.firmware_versions import Coverage

COVERAGE = Coverage("ArduPilot", (4, 5), (4, 8))
