"""What is left of a flight whose program is killed: what the autopilot was asked to do by itself."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from volery.base.errors import CapabilityError, UsageError
from volery.base.position import AboveHome, Position
from volery.base.time import S
from volery.kernel.waiting import sleep
from volery.run.assembly.vehicles import VehicleSettings, open_vehicles
from volery.run.connect import connect
from volery.run.fly import fly
from volery.run.last_defence import LastDefence
from volery.run.result import Options
from volery.trace.events import Text
from volery.vehicles import Drone, Rover, Vehicle
from volery.vehicles.driver import LinkLossAction

HEIGHT = 8.0


class Left(NamedTuple):
    """The vehicle two minutes after the program was killed: the truth, in metres about home."""

    armed: bool
    height: float
    away: float


def killed(url: str, action: LinkLossAction | None, how: str) -> Left:
    """Fly 40 m to the north, by a target or by a stream of velocities, and be silent from there on."""
    opened = open_vehicles({"drone": url}, {"drone": Drone}, VehicleSettings())
    drone, fleet = opened.vehicles[0], opened.fleet
    assert isinstance(drone, Drone)
    assert fleet is not None
    kernel = opened.kernel
    with kernel.adopt("script"):
        drone.wait_ready()
        if action is not None:
            LastDefence(drone, action).ask()
        drone.takeoff(HEIGHT)
        home = drone.home
        drone.goto(Position(home.latitude + 40 / 111_195, home.longitude, AboveHome(HEIGHT)))
        if how == "velocity":
            drone.set_velocity(east=0.5, lasting=2.0)
        drone.disconnect()
        sleep(kernel, 120 * S)
        truth = fleet.truth("drone")()
        armed = fleet.autopilots["drone"].vehicle.armed
    kernel.close()
    return Left(
        armed,
        truth.altitude.metres - home.altitude.metres,
        abs(truth.latitude - home.latitude) * 111_195,
    )


@pytest.mark.parametrize("how", ["target", "velocity"])
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
@pytest.mark.parametrize("action", ["return", "land", "hover"])
def test_the_autopilot_does_what_it_was_asked_for(autopilot: str, action: LinkLossAction, how: str) -> None:
    left = killed(f"sim:{autopilot}?start=warm", action, how)
    assert left.armed is (action == "hover")
    if action == "hover":
        assert left.height == pytest.approx(HEIGHT, abs=2.0)
    else:
        assert left.height < 0.3
    assert (left.away < 3.0) is (action == "return")


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_without_being_asked_it_stays_in_the_air(autopilot: str) -> None:
    assert killed(f"sim:{autopilot}?start=warm", None, "target").armed


@pytest.mark.parametrize(
    ("autopilot", "names"),
    [("ardupilot", ("FS_GCS_ENABLE", "FS_OPTIONS")), ("px4", ("NAV_DLL_ACT", "COM_OBL_RC_ACT"))],
)
def test_the_parameters_are_restored_at_the_end_and_the_user_is_told(
    autopilot: str, names: tuple[str, str]
) -> None:
    seen: list[dict[str, float]] = []
    told: list[str] = []

    def mission(drone: Drone) -> None:
        seen.append({name: drone.parameters.get(name) for name in names})

    url = f"sim:{autopilot}?start=warm"
    assert fly(mission, url, Options(if_killed="land", tell=told.append)).completed
    told = [line for line in told if "asked to land" in line or "did before" in line]
    asked, restored = told
    with connect(url) as drone:
        before = {name: drone.parameters.get(name) for name in names}
    assert seen[0] != before
    for name in names:
        assert f"{name}={seen[0][name]:g}, was {before[name]:g}" in asked
        assert f"{name}={before[name]:g}" in restored


def test_a_script_asks_for_it_when_it_connects() -> None:
    heard: list[str] = []
    drone = connect("sim:px4?start=warm", if_killed="return")
    drone.kernel.record = lambda event: heard.append(event.text) if isinstance(event, Text) else None
    assert drone.parameters.get("NAV_DLL_ACT") == 2.0
    drone.close()
    assert [line for line in heard if "NAV_DLL_ACT=0" in line]


def refusal(url: str, action: LinkLossAction, kind: type[Vehicle] = Drone) -> str:
    opened = open_vehicles({"it": url}, {"it": kind}, VehicleSettings())
    with opened.kernel.adopt("script"):
        opened.vehicles[0].wait_connected()
        with pytest.raises(CapabilityError) as raised:
            opened.vehicles[0].set_link_loss_action(action)
    opened.kernel.close()
    return str(raised.value)


def test_what_an_autopilot_cannot_be_asked_for_is_refused_by_name() -> None:
    assert "GEOFENCE_DATALINK_LOST_TIME" in refusal("sim:paparazzi", "land")
    assert "brakes and hovers" in refusal("sim:dji", "return")
    assert "a rover does not land" in refusal("sim:ardupilot?kind=rover", "land", Rover)
    assert "a rover does not land" in refusal("sim:px4?kind=rover", "land", Rover)


@pytest.mark.parametrize(("version", "name"), [("4.5", "SYSID_MYGCS"), ("4.8", "MAV_GCS_SYSID")])
def test_an_autopilot_that_listens_to_another_station_is_refused(version: str, name: str) -> None:
    with connect(f"sim:ardupilot?start=warm&version={version}") as drone:
        drone.parameters.set(name, 252)
        with pytest.raises(CapabilityError, match="system id 252 is lost, not for this program"):
            drone.set_link_loss_action("land")
        assert drone.parameters.get("FS_GCS_ENABLE") == 0.0


def test_a_wrong_action_is_refused_before_the_flight() -> None:
    with pytest.raises(UsageError, match="did you mean 'return'"):
        Options(if_killed="retrun")  # type: ignore[arg-type]
