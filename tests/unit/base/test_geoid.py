import pytest

from volery.base.errors import UsageError
from volery.base.geoid import EGM96, SEA_LEVEL, LevelGeoid, parse_geoid

PUBLISHED = [
    (38.6281550, 269.7791550, -31.628),
    (-14.6212170, 305.0211140, -2.969),
    (46.8743190, 102.4487290, -43.575),
    (-23.6174460, 133.8747120, 15.871),
    (38.6254730, 359.9995000, 50.066),
    (-0.4667440, 0.0023000, 17.329),
]
"""NIMA's test places for EGM96, with the heights of its own programme."""


def test_there_and_back() -> None:
    geoid = LevelGeoid(47.5)
    assert geoid.to_ellipsoidal(1.0, 2.0, 100.0) == 147.5
    assert geoid.to_amsl(1.0, 2.0, geoid.to_ellipsoidal(1.0, 2.0, 100.0)) == 100.0
    assert SEA_LEVEL.to_ellipsoidal(1.0, 2.0, 3.0) == 3.0


@pytest.mark.parametrize("separation", [-108.0, 87.0, float("nan")])
def test_a_separation_that_is_nowhere_on_earth(separation: float) -> None:
    with pytest.raises(UsageError, match="on Earth it is -107 to 86 m"):
        LevelGeoid(separation)


@pytest.mark.parametrize(("latitude", "longitude", "height"), PUBLISHED)
def test_egm96_where_its_makers_tell_the_height(latitude: float, longitude: float, height: float) -> None:
    assert EGM96.separation(latitude, longitude) == pytest.approx(height, abs=0.19)
    assert EGM96.separation(latitude, longitude - 360.0) == EGM96.separation(latitude, longitude)
    assert EGM96.to_amsl(latitude, longitude, 100.0) == pytest.approx(100.0 - height, abs=0.19)


def test_egm96_at_the_poles_and_where_there_is_no_place() -> None:
    for longitude in (-180.0, 0.0, 77.3, 180.0):  # the same height from wherever one looks
        assert EGM96.separation(90.0, longitude) == pytest.approx(13.606, abs=0.1)
        assert EGM96.separation(-90.0, longitude) == pytest.approx(-29.535, abs=0.1)
    for nowhere in ((91.0, 0.0), (float("nan"), 0.0), (0.0, float("inf"))):
        assert EGM96.separation(*nowhere) == 0.0


def test_a_geoid_by_its_name() -> None:
    assert parse_geoid("egm96") is EGM96
    assert parse_geoid("-12.5") == LevelGeoid(-12.5)
    with pytest.raises(UsageError, match="egm96, or a number of metres"):
        parse_geoid("egm08")
