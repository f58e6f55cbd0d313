"""Reactions of increasing rank, each tried until it shows an effect."""

from __future__ import annotations

from typing import Any

import pytest

from volery.base.errors import (
    CriticalBattery,
    LinkLost,
    NotArrived,
    OffTrack,
    OutOfBounds,
    Overridden,
    UsageError,
    VehicleError,
    VoleryError,
)
from volery.simulation.world.environment_models import Wind
from volery.testing.stage import SimulatedStage
from volery.vehicles import Capability, Drone, Escalation, Reaction
from volery.vehicles.address import parse
from volery.vehicles.escalation import escalate

FLIES = frozenset({Capability.HOLD, Capability.LAND})
DRIVES = frozenset({Capability.HOLD})
ALL = (Reaction.HOLD, Reaction.LAND, Reaction.KILL)


def error(kind: type[VehicleError]) -> VehicleError:
    return kind("craft_1", "go", "for a test")


@pytest.mark.parametrize(
    ("allowed", "kind", "able", "expected"),
    [
        ((Reaction.HOLD, Reaction.LAND), OutOfBounds, FLIES, (Reaction.HOLD, Reaction.LAND)),
        ((Reaction.HOLD, Reaction.LAND), CriticalBattery, FLIES, (Reaction.LAND,)),
        (ALL, CriticalBattery, FLIES, (Reaction.LAND, Reaction.KILL)),
        ((Reaction.HOLD,), CriticalBattery, FLIES, (Reaction.HOLD,)),
        ((Reaction.HOLD, Reaction.LAND), OutOfBounds, DRIVES, (Reaction.HOLD,)),
    ],
)
def test_what_is_tried(
    allowed: tuple[Reaction, ...], kind: type[VehicleError], able: Any, expected: tuple[Reaction, ...]
) -> None:
    assert Escalation(allowed).after(error(kind), able) == expected


@pytest.mark.parametrize("wrong", [(), (Reaction.LAND, Reaction.HOLD), (Reaction.HOLD, Reaction.HOLD)])
def test_reactions_that_do_not_increase_are_refused(wrong: tuple[Reaction, ...]) -> None:
    with pytest.raises(UsageError, match="in increasing rank"):
        Escalation(wrong)
    with pytest.raises(UsageError, match="above 0"):
        Escalation(time_to_act=0.0)


@pytest.mark.parametrize(
    ("problem", "tried", "said"),
    [
        (NotArrived("craft_1", "hold", "late"), [Reaction.HOLD, Reaction.LAND], "it is on the ground"),
        (
            Overridden("craft_1", "hold", "a pilot"),
            [Reaction.HOLD],
            "it did not hold: craft_1: hold: a pilot",
        ),
        (LinkLost("craft_1: hold"), [Reaction.HOLD], "it did not hold: craft_1: hold"),
        (None, [Reaction.HOLD], "it holds there"),
    ],
)
def test_the_next_one_follows_unless_another_has_control(
    problem: VoleryError | None, tried: list[Reaction], said: str
) -> None:
    performed = []

    def perform(reaction: Reaction) -> None:
        performed.append(reaction)
        if reaction is Reaction.HOLD and problem is not None:
            raise problem

    assert escalate(Escalation(), error(OutOfBounds), FLIES, perform).endswith(said)
    assert performed == tried


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4", "paparazzi"])
def test_a_drone_that_the_wind_carries_away_is_landed(autopilot: str) -> None:
    """This airframe cannot stay in 20 m/s: hold() has no effect, and the landing is the next reaction."""
    stage = SimulatedStage(parse(f"sim:{autopilot}"), Drone, 3)
    raised: list[str] = []

    def flight() -> None:
        stage.drone.takeoff(10)
        stage.fleet.world.set_wind(Wind(east=20.0))
        stage.sleep(60.0)
        try:
            stage.drone.goto(stage.at(0.0, 0.0, 10.0))
        except VehicleError as error:
            raised.append(f"{type(error).__name__}: {error}")

    stage.perform(flight)
    assert raised[0].startswith(OffTrack.__name__)
    assert "off its commanded place, beyond 15 m (Limits.off_track)" in raised[0]
    done = [(one.operation, one.outcome) for one in stage.events if hasattr(one, "outcome")]
    assert ("hold", "NotArrived") in done
    assert ("land", "ok") in done
    assert not stage.drone.armed
    stage.close()


@pytest.mark.parametrize(("allowed", "stopped"), [((Reaction.HOLD, Reaction.LAND), False), (ALL, True)])
def test_motors_are_stopped_in_the_air_only_where_that_is_stated(
    allowed: tuple[Reaction, ...], stopped: bool
) -> None:
    """An updraught of 25 m/s carries this airframe away, which neither holds nor sinks."""
    stage = SimulatedStage(parse("sim:ardupilot"), Drone, 3)
    stage.drone.escalation = Escalation(allowed)

    def flight() -> None:
        stage.drone.takeoff(10)
        stage.fleet.world.set_wind(Wind(up=25.0))
        stage.sleep(45.0)

    stage.perform(flight)
    done = [(one.operation, one.outcome) for one in stage.events if hasattr(one, "outcome")]
    assert done[1:3] == [("hold", "NotArrived"), ("land", "NotArrived")]
    assert (("kill", "ok") in done) is stopped
    assert stage.drone.armed is not stopped
    stage.close()
