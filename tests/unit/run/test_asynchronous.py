"""``connect_async`` on simulated vehicles: the blocking calls, awaited."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from volery.base.errors import CapabilityError, Refused, UsageError
from volery.run.asynchronous import connect_async


def test_a_flight_with_two_calls_side_by_side() -> None:
    async def program() -> tuple[Any, Any, Any]:
        async with connect_async("sim:px4") as drone:
            await drone.takeoff(5)
            both = asyncio.gather(
                drone.set_heading(90), drone.run(lambda one: one.parameters.get("MPC_XY_CRUISE"))
            )
            _, cruise = await both
            position = await drone.get("position")
            await drone.land()
            return cruise, position, await drone.get("armed")

    cruise, position, armed = asyncio.run(program())
    assert cruise > 0.0
    assert position.altitude.metres > 0.0
    assert armed is False


def test_state_is_followed_while_a_call_is_under_way() -> None:
    async def program() -> list[float]:
        async with connect_async("sim:ardupilot?start=warm") as drone:
            rising = asyncio.ensure_future(drone.takeoff(5))
            heights: list[float] = []
            async for height in drone.stream("altitude", period=0.5):
                heights.append(height.metres)
                if rising.done():
                    break
            with pytest.raises(UsageError, match="must be above 0"):
                await anext(drone.stream("altitude", period=0.0))
            return heights

    heights = asyncio.run(program())
    assert heights[0] < 0.5
    assert heights[-1] > 4.0
    assert len({round(height, 1) for height in heights}) > 2


def test_errors_reach_the_caller() -> None:
    async def program() -> None:
        async with connect_async("sim:ardupilot") as drone:
            with pytest.raises(Refused, match="on the ground"):
                await drone.set_heading(90)
            with pytest.raises(UsageError, match="has no such property"):
                await drone.get("positon")
            with pytest.raises(AttributeError, match="is no method"):
                drone.position  # noqa: B018 - the mistake that is tested
            with pytest.raises(AttributeError, match="has no 'fly'"):
                drone.fly  # noqa: B018 - likewise

    asyncio.run(program())


def test_a_cancelled_call_ends_and_the_drone_lands_at_the_end() -> None:
    async def program() -> str:
        async with connect_async("sim:ardupilot") as drone:
            await drone.takeoff(5)
            turning = asyncio.ensure_future(drone.run(lambda one: one.set_velocity(north=1.0, lasting=5.0)))
            await turning
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(drone.run(_for_ever), 0.2)
            return str(await drone.get("mode"))

    assert asyncio.run(program()) == "GUIDED"


def _for_ever(drone: Any) -> None:
    while True:
        drone.kernel.sleep_until(drone.kernel.now() + 100_000_000)


def test_a_connection_that_fails() -> None:
    async def program() -> None:
        async with connect_async("sim:nothing"):
            raise AssertionError

    with pytest.raises((UsageError, CapabilityError)):
        asyncio.run(program())
