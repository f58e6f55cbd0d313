import pytest

from volery.base.errors import UsageError
from volery.base.position import AMSL, AboveGround, AboveHome, Ellipsoidal, Position


@pytest.mark.parametrize(
    ("latitude", "longitude", "said"),
    [
        (90.1, 0.0, "latitude 90.1 is off the globe: -90 to 90"),
        (-91.0, 0.0, "latitude -91.0 is off the globe"),
        (0.0, 180.5, "longitude 180.5 is off the globe: -180 to 180"),
        (float("nan"), 0.0, "latitude nan is off the globe"),
        (0.0, float("inf"), "longitude inf is off the globe"),
    ],
)
def test_off_the_globe(latitude: float, longitude: float, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        Position(latitude, longitude, AMSL(0.0))


@pytest.mark.parametrize("kind", [AMSL, Ellipsoidal, AboveHome, AboveGround])
@pytest.mark.parametrize("metres", [float("nan"), float("inf"), -1e308, 10**400])
def test_no_altitude(kind: type[AMSL], metres: float) -> None:
    with pytest.raises(
        UsageError, match=r"an altitude of (nan|inf|-1e\+308|so many) m: it is at most 1e\+09 m up"
    ):
        kind(metres)


def test_altitudes_of_two_kinds_are_never_equal() -> None:
    assert AMSL(10.0) == AMSL(10.0)
    assert len({AMSL(10.0), Ellipsoidal(10.0), AboveHome(10.0), AboveGround(10.0)}) == 4


def test_an_altitude_says_what_it_is_above() -> None:
    said = [str(kind(12.5)) for kind in (AMSL, Ellipsoidal, AboveHome, AboveGround)]
    assert said == ["12.5 m AMSL", "12.5 m above the ellipsoid", "12.5 m above home", "12.5 m above ground"]


def test_a_position_reads_well() -> None:
    assert str(Position(37.123456789, -3.5, AboveHome(10.0))) == "37.1234568, -3.5000000, 10 m above home"


def test_values_do_not_change() -> None:
    altitude = AMSL(1.0)
    with pytest.raises(AttributeError):
        altitude.metres = 5.0
    with pytest.raises(AttributeError):
        Position(1.0, 2.0, altitude).latitude = 5.0


@pytest.mark.parametrize("altitude", [940, 940.0, "940", None])
def test_a_bare_altitude_is_refused_with_what_to_write(altitude: object) -> None:
    with pytest.raises(
        UsageError, match=rf"measured from, as in AMSL\({altitude}\) or AboveHome\({altitude}\)"
    ):
        Position(46.0, 7.0, altitude)  # type: ignore[arg-type]


def test_values_that_are_no_numbers_are_refused() -> None:
    with pytest.raises(UsageError, match=r"Position\('46', 7.0, ...\): latitude and longitude are numbers"):
        Position("46", 7.0, AMSL(0.0))  # type: ignore[arg-type]
    with pytest.raises(
        UsageError, match=r"AMSL\('940'\): an altitude is a number of metres, as in AMSL\(10\)"
    ):
        AMSL("940")  # type: ignore[arg-type]


def test_swapped_coordinates_are_suspected() -> None:
    with pytest.raises(UsageError, match=r"did you mean Position\(46.0, -103.9, ...\)"):
        Position(-103.9, 46.0, AMSL(0.0))
