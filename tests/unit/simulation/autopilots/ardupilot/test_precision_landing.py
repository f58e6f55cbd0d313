"""Landing and loiter over a target that LANDING_TARGET or a simulated beacon shows."""

from __future__ import annotations

from math import atan, dist
from typing import Any

import pytest

from volery.base.frames import world_to_body
from volery.base.time import MS
from volery.simulation.autopilots.ardupilot.dataflash import encode
from volery.simulation.autopilots.ardupilot.feature import build_of
from volery.simulation.autopilots.ardupilot.precision_landing import precision_of
from volery.simulation.autopilots.ardupilot.versions import V4_5

ARM, MODE, TAKEOFF, AUX = 400, 176, 22, 218
GUIDED, LOITER, RTL, LAND = 4, 5, 6, 9
PRECISION_LOITER = 39
BODY_FRD = 12


@pytest.fixture
def flying(station: Any) -> Any:
    """Makes a copter that hovers in GUIDED."""

    def made(height: float = 10.0, **parameters: float) -> Any:
        rig = station(logging=True, parameters={"PLND_ENABLED": 1, "PLND_TYPE": 1, **parameters})
        rig.run(0.5)
        assert rig.command(MODE, 1.0, GUIDED) == 0
        assert rig.command(ARM, 1.0) == 0
        assert rig.command(TAKEOFF, 0, 0, 0, 0, 0, 0, height) == 0
        rig.run(10.0 + height / 2.0)
        rig.vehicle.rc.transmitter[2] = 1500
        return rig

    return made


def shows(rig: Any, north: float, east: float, *, position: bool = False, distance: bool = True) -> Any:
    """Send LANDING_TARGET of a place on the ground ten times a second from now on; returns its timer."""

    def send() -> None:
        estimate = rig.vehicle.estimate
        here = estimate.position
        x, y, z = world_to_body(estimate.quaternion, (north - here[0], east - here[1], -here[2]))
        away = dist((x, y, z), (0.0, 0.0, 0.0)) if distance else 0.0
        fields: dict[str, Any] = {"angle_x": atan(y / z), "angle_y": -atan(x / z), "distance": away}
        if position:
            fields = {"x": x, "y": y, "z": z, "distance": away, "frame": BODY_FRD, "position_valid": 1}
        if z > 0.1:
            rig.send("LANDING_TARGET", **fields)

    return rig.kernel.every(100 * MS, send)


def from_target(rig: Any, north: float, east: float) -> float:
    return dist(rig.vehicle.estimate.position[:2], (north, east))


@pytest.mark.parametrize("position", [False, True])
@pytest.mark.parametrize("mode", [LAND, RTL])
def test_a_copter_lands_on_the_target(position: bool, mode: int, flying: Any) -> None:
    rig = flying(RTL_ALT=0, RTL_LOIT_TIME=0)
    shows(rig, 4.0, -4.0, position=position)
    rig.run(3.0)
    texts = [text for text in rig.texts() if text.startswith("PrecLand")]
    assert texts == ["PrecLand: Target Found", "PrecLand: Init Complete"]
    assert rig.command(MODE, 1.0, mode) == 0
    rig.run_until(lambda: not rig.vehicle.armed)
    assert from_target(rig, 4.0, -4.0) < 0.3


def test_it_does_not_descend_far_from_the_target(flying: Any) -> None:
    rig = flying(PLND_XY_DIST_MAX=1.0, WPNAV_ACCEL=50)
    shows(rig, 8.0, 0.0)
    rig.run(3.0)
    rig.command(MODE, 1.0, LAND)
    rig.run_until(lambda: from_target(rig, 8.0, 0.0) < 2.0)
    assert rig.height > 9.5


def test_the_range_finder_gives_the_distance_that_the_message_lacks(flying: Any) -> None:
    without = flying()
    shows(without, 3.0, 0.0, distance=False)
    without.run(1.0)
    assert not any(text.startswith("PrecLand") for text in without.texts())
    rig = flying(RNGFND1_TYPE=1, RNGFND1_MAX_CM=4000)
    shows(rig, 3.0, 0.0, distance=False)
    rig.run(3.0)
    assert precision_of(rig.vehicle).place == pytest.approx((3.0, 0.0), abs=0.3)


def test_a_target_that_is_lost_no_longer_counts(flying: Any) -> None:
    rig = flying()
    timer = shows(rig, 4.0, 0.0)
    rig.run(3.0)
    timer.cancel()
    rig.run(3.0)
    assert rig.texts()[-1] == "PrecLand: Target Lost"
    rig.command(MODE, 1.0, LAND)
    rig.run_until(lambda: not rig.vehicle.armed)
    assert from_target(rig, 0.0, 0.0) < 0.5
    short = flying()
    timer = shows(short, 4.0, 0.0)
    short.run(1.0)
    timer.cancel()
    short.run(1.0)
    assert short.texts()[-1] == "PrecLand: Init Failed"


def test_loiter_is_held_over_the_target_while_the_switch_is_up(flying: Any) -> None:
    rig = flying()
    rig.command(MODE, 1.0, LOITER)
    shows(rig, 3.0, 2.0)
    rig.run(5.0)
    assert from_target(rig, 0.0, 0.0) < 0.5
    assert rig.command(AUX, PRECISION_LOITER, 2) == 0
    rig.run(10.0)
    assert from_target(rig, 3.0, 2.0) < 0.3
    assert rig.height == pytest.approx(10.0, abs=0.5)
    rig.vehicle.rc.transmitter[1] = 1200  # the pilot decides
    rig.run(3.0)
    assert from_target(rig, 3.0, 2.0) > 2.0


@pytest.mark.parametrize("kind", [2, 4])
def test_a_simulated_beacon_is_seen_by_the_range_finder_and_logged(kind: int, flying: Any) -> None:
    north = 4.0 / 111_300.0
    rig = flying(PLND_TYPE=kind, RNGFND1_TYPE=1, SIM_PLD_ENABLE=1, SIM_PLD_LAT=46.0 + north, SIM_PLD_LON=7.0)
    rig.run(3.0)
    rig.command(MODE, 1.0, LAND)
    rig.run_until(lambda: not rig.vehicle.armed)
    rig.run(0.5)
    assert from_target(rig, 4.0, 0.0) < 0.6  # the parameters are single precision
    forms = build_of(rig.vehicle).log_forms
    number = next(form.number for form in forms if form.name == "PL")
    assert b"\xa3\x95" + bytes([number]) in encode(rig.vehicle.logs[0], V4_5, forms)


def test_without_precision_landing_the_message_means_nothing(flying: Any) -> None:
    rig = flying(PLND_ENABLED=0)
    shows(rig, 4.0, 0.0)
    rig.run(3.0)
    assert not any(text.startswith("PrecLand") for text in rig.texts())
