"""Positions on the globe: WGS-84 degrees and an altitude with its reference.

The worst accidents that users report come from mixed altitudes. So the four kinds are four types, and none
converts into another without the reference that the conversion needs.
"""

from __future__ import annotations

from dataclasses import dataclass

from volery.base.errors import UsageError

LARGEST_ALTITUDE = 1e9
"""Metres above which an altitude, up or down, is taken for a mistake."""


@dataclass(frozen=True)
class _Altitude:
    metres: float

    def __init__(self, metres: float) -> None:
        """Store the value without dataclass overhead: one is created for most messages of a vehicle."""
        try:
            sensible = -LARGEST_ALTITUDE <= metres <= LARGEST_ALTITUDE
        except TypeError:
            kind = type(self).__name__
            raise UsageError(
                f"{kind}({metres!r}): an altitude is a number of metres, as in {kind}(10)"
            ) from None
        if not sensible:
            stated = metres if isinstance(metres, float) else "so many"
            raise UsageError(f"an altitude of {stated} m: it is at most {LARGEST_ALTITUDE:g} m up or down")
        self.__dict__["metres"] = metres

    def __str__(self) -> str:
        return f"{self.metres:g} m {self.reference}"

    @property
    def reference(self) -> str:
        """Reference of the altitude, for messages."""
        raise TypeError("a bare altitude; use AMSL, Ellipsoidal, AboveHome or AboveGround")


class AMSL(_Altitude):
    """Metres above mean sea level (the geoid): what maps, charts and autopilots call altitude."""

    reference = "AMSL"


class Ellipsoidal(_Altitude):
    """Metres above the WGS-84 ellipsoid: what a bare GNSS receiver and ROS's NavSatFix give."""

    reference = "above the ellipsoid"


class AboveHome(_Altitude):
    """Metres above the vehicle's home position."""

    reference = "above home"


class AboveGround(_Altitude):
    """Metres above the terrain straight below."""

    reference = "above ground"


Altitude = AMSL | Ellipsoidal | AboveHome | AboveGround


@dataclass(frozen=True)
class Position:
    """A point: WGS-84 degrees, north and east positive, and a typed altitude."""

    latitude: float
    longitude: float
    altitude: Altitude

    def __init__(self, latitude: float, longitude: float, altitude: Altitude) -> None:
        """Check the arguments, which come from missions and consoles without a type checker."""
        try:
            if not -90.0 <= latitude <= 90.0:
                swapped = abs(longitude) <= 90.0 and abs(latitude) <= 180.0
                hint = f"; did you mean Position({longitude}, {latitude}, ...)?" if swapped else ""
                raise UsageError(
                    f"latitude {latitude} is off the globe: -90 to 90 degrees, north positive{hint}"
                )
            if not -180.0 <= longitude <= 180.0:
                raise UsageError(
                    f"longitude {longitude} is off the globe: -180 to 180 degrees, east positive"
                )
        except TypeError:
            raise UsageError(
                f"Position({latitude!r}, {longitude!r}, ...): latitude and longitude are numbers, in degrees"
            ) from None
        if not isinstance(altitude, _Altitude):
            raise UsageError(
                f"Position({latitude}, {longitude}, {altitude!r}): say what the altitude is measured from, "
                f"as in AMSL({altitude}) or AboveHome({altitude})"
            )
        own = self.__dict__
        own["latitude"], own["longitude"], own["altitude"] = latitude, longitude, altitude

    def __str__(self) -> str:
        return f"{self.latitude:.7f}, {self.longitude:.7f}, {self.altitude}"
