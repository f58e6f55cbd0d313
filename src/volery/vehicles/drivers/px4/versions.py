"""What PX4's messages and parameters mean, by version.

The rules were read in the sources of v1.13.0 to v1.17.0 and of the branch release/1.18 (8 July 2026).
"""

from __future__ import annotations

from volery.links.mavlink_messages import constant
from volery.vehicles.firmware_versions import Coverage, Meaning, VersionRule
from volery.vehicles.services import ParameterRules

COVERAGE = Coverage("PX4", (1, 13), (1, 18))

PARAMETER_RULES = ParameterRules(
    volatile={"_HASH_CHECK", "COM_FLIGHT_UUID", "EKF2_MAG_DECL", "LND_FLIGHT_T_HI", "LND_FLIGHT_T_LO"}
)
"""It writes these itself: volatile in its metadata and no calibration, and the checksum over all."""

NO_HORIZONTAL_POSITION: VersionRule[int] = VersionRule(
    "flags of ESTIMATOR_STATUS with which there is no horizontal position",
    Meaning(
        (1, 13),
        constant("ESTIMATOR_CONST_POS_MODE"),
        "EKF/ekf_helper.cpp, get_ekf_soln_status: set if there is no horizontal velocity",
    ),
    Meaning(
        (1, 16),
        0,
        "EKF/ekf_helper.cpp, get_ekf_soln_status: the bit is also set at rest, with a valid position",
    ),
)

HOME_ALTITUDE_CORRECTED: VersionRule[bool] = VersionRule(
    "whether home's altitude is corrected in the air, for 120 s after a take-off",
    Meaning((1, 13), False, "commander/HomePosition.cpp, update: home stays where it was set"),
    Meaning(
        (1, 17),
        True,
        "commander/HomePosition.cpp, update: by the difference of barometer and GNSS altitude, "
        "with the noise of the latter, at each fix",
    ),
)
