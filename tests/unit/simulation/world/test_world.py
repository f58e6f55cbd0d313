"""The time grid: reads have no effect on results."""

import math

import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.base.frames import LocalFrame
from volery.base.time import MS
from volery.simulation.world.body_specs import Multirotor, WheeledRover
from volery.simulation.world.environment_models import Terrain, Wind, magnetic_field
from volery.simulation.world.scene import Scene
from volery.simulation.world.sensors import declared_sigma, sensor_suite
from volery.simulation.world.state_layout import (
    S_GUST,
    S_POSITION,
    S_RESTING,
    S_ROTORS,
    U_PAYLOAD,
    U_THROTTLE,
    U_WIND,
)
from volery.simulation.world.world import STEP, World

SPECS = (Multirotor(), WheeledRover(at=(20.0, 0.0, 0.0)), Multirotor(at=(0.0, 30.0, 0.0), sensors="rtk"))


def fly(clock, frame, reads, seed=3, wind=None):
    """Run three bodies for a second with fixed inputs; *reads* are additional ones (milliseconds, body)."""
    clock.now = 0
    world = World(clock, SPECS, seed=seed, frame=frame, wind=wind)
    for millisecond in range(1000):
        clock.now = millisecond * MS
        if millisecond % 100 == 7:
            world.set_input(0, U_THROTTLE, 0.7, 0.7, 0.7, 0.7)
            world.set_input(1, U_THROTTLE, 0.1, 0.3)
        for _ in range(reads.count((millisecond, 0))):
            world.advance_to_now(0)
        for body in (1, 2):
            if (millisecond, body) in reads:
                world.advance_to_now(body)
    clock.now = 1000 * MS
    for body in range(3):
        world.advance_to_now(body)
    return world.arrays.rows.tobytes()


def test_additional_reads_change_no_byte(clock, frame):
    alone = fly(clock, frame, [])
    assert fly(clock, frame, [(m, b) for m in range(0, 1000, 3) for b in range(3)]) == alone
    assert fly(clock, frame, [(8, 0), (8, 0), (9, 0), (10, 2)]) == alone


def test_another_seed_gives_other_noise_and_the_same_seed_the_same(clock, frame):
    wind = Wind(east=3.0, gust=1.0)
    assert fly(clock, frame, [], 3, wind) == fly(clock, frame, [], 3, wind)
    assert fly(clock, frame, [], 4, wind) != fly(clock, frame, [], 3, wind)


def test_an_input_acts_from_the_next_grid_step_on(clock, frame):
    world = World(clock, [Multirotor()], frame=frame)
    clock.now = 10 * STEP
    world.advance_to_now(0)
    world.set_input(0, U_THROTTLE, 0.5, 0.5, 0.5, 0.5)
    clock.now = 11 * STEP + STEP - 1
    assert world.truth(0).rotors[0] == 0.0
    clock.now = 12 * STEP
    assert world.truth(0).rotors[0] > 0.0


def test_a_state_holds_over_its_whole_step(clock, frame):
    world = World(clock, [Multirotor()], frame=frame)
    clock.now = 5 * STEP
    first = world.truth(0)
    clock.now = 6 * STEP - 1
    assert world.truth(0) is not first
    assert world.truth(0) == first


def test_bodies_that_are_not_read_are_not_advanced(clock, frame):
    world = World(clock, SPECS, frame=frame)
    for _ in range(20):
        clock.wait(0.1)
        world.advance_to_now(0)
    assert world.arrays.reached.tolist() == [1000, 0, 0]
    world.advance_to_now(2)
    assert world.arrays.reached.tolist() == [1000, 0, 1000]


def test_bodies_that_are_read_advance_together_in_one_call(clock, frame):
    world = World(clock, SPECS, frame=frame)
    for body in range(3):
        world.advance_to_now(body)
    before = world.advances
    clock.wait(0.1)
    for body in range(3):
        world.advance_to_now(body)
    assert world.advances == before + 1


def test_a_resting_body_does_not_move_or_turn(clock, frame):
    world = World(clock, [Multirotor(heading_deg=30.0)], frame=frame, wind=Wind(east=8.0, gust=2.0))
    before = world.truth(0)
    clock.wait(20)
    after = world.truth(0)
    assert after.position == before.position
    assert after.attitude == before.attitude
    assert after.on_ground


def test_the_rotors_of_a_landed_body_come_to_a_stop(clock, frame):
    world = World(clock, [Multirotor()], frame=frame)
    world.set_input(0, U_THROTTLE, 0.1, 0.1, 0.1, 0.1)
    clock.wait(2)
    assert world.truth(0).rotors[0] > 10.0
    world.set_input(0, U_THROTTLE, 0.0, 0.0, 0.0, 0.0)
    clock.wait(5)
    assert not any(world.truth(0).rotors)


def test_a_state_that_is_not_a_number_is_reported(clock, frame):
    world = World(clock, SPECS, frame=frame)
    world.set_input(2, U_THROTTLE, math.nan, 0.1, 0.1, 0.1)
    world.set_input(0, U_THROTTLE, 0.1, 0.1, 0.1, 0.1)
    clock.wait(0.1)
    world.truth(0)
    with pytest.raises(ArithmeticError, match="invalid arithmetic"):
        world.truth(2)


def test_wind_carries_a_body_with_drag(clock, frame, ideal_battery):
    spec = Multirotor(sensors="perfect", battery=ideal_battery)
    world = World(clock, [spec], frame=frame, wind=Wind(east=5.0, north=-2.0))
    row = world.arrays.rows[0]
    row[S_POSITION + 2] = 1000.0
    row[S_RESTING] = 0.0
    row[S_ROTORS : S_ROTORS + 4] = spec.hover_speed
    row[U_THROTTLE : U_THROTTLE + 4] = spec.hover_speed / spec.top_speed
    clock.wait(60)
    east, north, up = world.truth(0).velocity
    assert (east, north) == pytest.approx((5.0, -2.0), abs=0.01)
    assert up == pytest.approx(0.0, abs=0.01)


def test_terrain_is_bilinear_between_its_posts_and_level_beyond(clock, frame):
    terrain = Terrain(heights=((0.0, 10.0), (20.0, 30.0)), spacing=10.0)
    assert terrain.height(5.0, 5.0) == pytest.approx(15.0, abs=1e-5)
    assert terrain.height(-50.0, 0.0) == pytest.approx(0.0, abs=1e-3)
    assert terrain.height(50.0, 50.0) == pytest.approx(30.0, abs=1e-3)
    world = World(
        clock, [WheeledRover(at=(0.0, 5.0, 0.0), heading_deg=90.0)], frame=frame, scene=Scene(terrain=terrain)
    )
    world.set_input(0, U_THROTTLE, 0.0, 0.1)
    clock.wait(4)
    east, _, up = world.truth(0).position
    assert up == pytest.approx(10.0 + min(east, 10.0), abs=1e-3)
    assert east > 2.0


def test_level_ground_has_one_altitude_far_from_the_origin(clock, frame):
    for east, north in ((0.0, 0.0), (8_000.0, 0.0), (-3_000.0, 7_000.0)):
        _, _, amsl = frame.from_enu((east, north, Terrain().height(east, north)))
        assert amsl == pytest.approx(frame.amsl, abs=0.05)


def test_gusts_have_their_deviation_and_their_correlation_time(clock, frame):
    wind = Wind(east=6.0, gust=1.5, gust_length=12.0)
    world = World(clock, [Multirotor(sensors="perfect")] * 10, frame=frame, wind=wind)
    samples = []
    for _ in range(1500):
        clock.wait(0.2)
        for body in range(10):
            world.advance_to_now(body)
        samples.append(world.arrays.rows[:, S_GUST : S_GUST + 3].copy())
    gusts = np.array(samples)
    assert gusts[..., :2].std() == pytest.approx(1.5, rel=0.08)
    assert gusts[..., 2].std() == pytest.approx(0.75, rel=0.1)
    north = gusts[..., 1]
    later = (north[10:] * north[:-10]).mean() / north.var()  # two seconds apart, with T = 12 / 6 s
    assert later == pytest.approx(math.exp(-1.0), abs=0.08)


def test_gusts_at_two_bodies_differ(clock, frame):
    world = World(clock, [Multirotor(), Multirotor()], frame=frame, wind=Wind(east=6.0, gust=1.5))
    clock.wait(5)
    world.advance_to_now(0)
    world.advance_to_now(1)
    assert world.arrays.rows[0, S_GUST] != world.arrays.rows[1, S_GUST]


def test_the_wind_can_change(clock, frame):
    world = World(clock, [Multirotor()], frame=frame)
    world.set_wind(Wind(east=3.0))
    clock.now = STEP
    world.advance_to_now(0)
    assert world.arrays.rows[0, U_WIND] == 3.0


@pytest.mark.parametrize("terrain", [{"heights": ((1.0,), (1.0, 2.0))}, {"heights": ((),)}, {"spacing": 0.0}])
def test_impossible_terrain_is_refused(terrain):
    with pytest.raises(UsageError, match="terrain"):
        Terrain(**terrain)


def test_impossible_wind_and_empty_worlds_are_refused(clock, frame):
    with pytest.raises(UsageError, match="gust"):
        Wind(gust=-1.0)
    with pytest.raises(UsageError, match="at least one"):
        World(clock, [], frame=frame)


def test_an_unknown_sensor_suite_is_refused_with_the_valid_names(clock, frame):
    with pytest.raises(
        UsageError, match=r"'consumr' \(did you mean 'consumer'\?\); there is consumer, perfect, rtk or sih"
    ):
        World(clock, [Multirotor(sensors="consumr")], frame=frame)


def test_declared_deviations_differ_between_sensor_suites():
    assert declared_sigma("consumer").horizontal > 0.5
    assert declared_sigma("rtk").horizontal < 0.05
    assert declared_sigma("perfect") == (0.0, 0.0)
    assert sensor_suite("rtk").gps.fix_type == 6


@pytest.mark.parametrize(
    ("latitude", "longitude", "declination", "inclination", "gauss"),
    [(47.40, 8.55, 3.3, 63.4, 0.484), (-35.36, 149.17, 12.4, -66.2, 0.583)],
)
def test_the_magnetic_field_matches_published_charts(latitude, longitude, declination, inclination, gauss):
    north, east, down = magnetic_field(LocalFrame(latitude, longitude, 0.0))
    across = math.hypot(north, east)
    assert math.degrees(math.atan2(east, north)) == pytest.approx(declination, abs=4.0)
    assert math.degrees(math.atan2(down, across)) == pytest.approx(inclination, abs=3.0)
    assert math.hypot(across, down) == pytest.approx(gauss, rel=0.06)


def test_payload_power_acts_from_the_next_grid_step_on(clock, frame):
    world = World(clock, [WheeledRover()], frame=frame)
    world.payload_power(0, 12.0)
    assert world.arrays.rows[0, U_PAYLOAD] == 0.0
    clock.wait(10)
    truth = world.truth(0)
    assert truth.payload_j == pytest.approx(12.0 * (10.0 - STEP / 1e9), rel=1e-9)
