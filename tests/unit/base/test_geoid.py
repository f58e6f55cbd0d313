import pytest

from volery.base.errors import UsageError
from volery.base.geoid import SEA_LEVEL, Geoid


def test_there_and_back() -> None:
    geoid = Geoid(47.5)
    assert geoid.to_ellipsoidal(100.0) == 147.5
    assert geoid.to_amsl(geoid.to_ellipsoidal(100.0)) == 100.0
    assert SEA_LEVEL.to_ellipsoidal(3.0) == 3.0


@pytest.mark.parametrize("separation", [-108.0, 87.0, float("nan")])
def test_a_separation_that_is_nowhere_on_earth(separation: float) -> None:
    with pytest.raises(UsageError, match="on Earth it is -107 to 86 m"):
        Geoid(separation)
