import math

import pytest

from volery.base.errors import EstimateError
from volery.base.warmth import Warmth
from volery.cost import Price, RosLaw, Tariff, load_catalogue
from volery.cost.catalogue import parse_catalogue

INTEL, ARM = "intel-i5-3470", "rpi4-cortex-a72"
PLATFORMS = ((INTEL, 1600), (INTEL, 3000), (ARM, 600), (ARM, 1500))

FOLLOWING = Warmth(follows=True)
POINTS = {
    "spin_once_first": (21500, 20380, 54381, 24403),
    "spin_once_next": (6377, 6270, 21860, 9048),
    "init": (433923, 300054, 18795260, 16195670),
    "node_handle": (4137052, 2322393, 5583100, 4885054),
    "service_client": (58706, 47143, 78275, 68099),
    "advertise": (316862, 195434, 591091, 525178),
    "subscribe": (1078574, 731497, 1445835, 1360615),
    "advertise_service": (142290, 121073, 189720, 24403),
}
"""The paper's Tables I and II, ns, on the four platforms."""


def law(kind: str) -> RosLaw:
    return load_catalogue().processor(kind).ros_law("roscpp")


@pytest.mark.parametrize("call", POINTS)
@pytest.mark.parametrize(("index", "platform"), list(enumerate(PLATFORMS)))
def test_calls_without_an_x_are_the_tables(call: str, index: int, platform: tuple[str, int]) -> None:
    kind, frequency = platform
    price = Tariff(law(kind), frequency)(call, 0)
    assert (price.caller, price.background) == (POINTS[call][index], 0)


def test_between_its_two_frequencies_a_call_is_on_their_line() -> None:
    assert Tariff(law(INTEL), 2300)("init", 0).caller == round((433923 + 300054) / 2)
    assert Tariff(law(ARM), 1050)("subscribe", 0).caller == round((1445835 + 1360615) / 2)


@pytest.mark.parametrize(
    ("platform", "constant", "each"),
    [
        ((INTEL, 1600), 1.959 * 1600 + 197717, -7.78 * 1600 + 51020),
        ((INTEL, 3000), 1.959 * 3000 + 197717, -7.78 * 3000 + 51020),
        ((ARM, 600), -128.46 * 600 + 254162, -22.656 * 600 + 85844),
        ((ARM, 1500), -128.46 * 1500 + 254162, -22.656 * 1500 + 85844),
    ],
)
def test_publish_splits_into_caller_and_background(
    platform: tuple[str, int], constant: float, each: float
) -> None:
    kind, frequency = platform
    for subscribers in (0, 1, 5):
        price = Tariff(law(kind), frequency)("publish", subscribers)
        assert price.caller == round(constant)
        assert price.background == round(each * subscribers)


@pytest.mark.parametrize(
    ("platform", "slope", "constant"),
    [
        ((INTEL, 1600), 1.5645, -1.498 * 1600 + 22697),
        ((INTEL, 3000), 1.1025, -1.498 * 3000 + 22697),
        ((ARM, 600), 1.5611, -27.51 * 600 + 57231),
        ((ARM, 1500), 0.6647, -27.51 * 1500 + 57231),
    ],
)
def test_sleep_is_background_with_its_slope_per_gigahertz(
    platform: tuple[str, int], slope: float, constant: float
) -> None:
    kind, frequency = platform
    price = Tariff(law(kind), frequency)("sleep", 100_000)
    assert price.caller == 0
    assert math.isclose(price.background, slope * 100_000 + constant, abs_tol=1.0)


def test_the_first_spin_of_a_node_costs_more_than_the_next() -> None:
    assert Tariff(law(INTEL), 3000)("spin_once", 1).caller == POINTS["spin_once_first"][1]
    assert Tariff(law(INTEL), 3000)("spin_once", 0).caller == POINTS["spin_once_next"][1]


def test_an_unknown_call_is_an_error_and_never_zero() -> None:
    with pytest.raises(EstimateError, match=r"'fly' of roscpp on intel-i5-3470.*publish"):
        Tariff(law(INTEL), 3000)("fly", 0)


def test_out_of_range_it_extrapolates_and_warns() -> None:
    assert law(INTEL).warnings(3000) == ()
    [warning] = law(INTEL).warnings(3600)
    assert "intel-i5-3470 at 3600 MHz" in warning
    assert "1600 to 3000 MHz" in warning
    assert Tariff(law(INTEL), 3600)("init", 0).flags == (warning,)


def test_a_negative_estimate_is_an_error() -> None:
    with pytest.raises(EstimateError, match=r"negative time for 'sleep' at 2500 MHz.*600 to 1500 MHz"):
        Tariff(law(ARM), 2500)("sleep", 100_000)


def test_a_python_node_charged_with_the_figures_of_roscpp_is_flagged() -> None:
    borrowed = load_catalogue().processor(ARM).ros_law("rospy")
    own = law(ARM)
    assert Tariff(borrowed, 600)("init", 0)[:2] == Tariff(own, 600)("init", 0)[:2]
    assert Tariff(own, 600)("init", 0).flags == ()
    [flag] = Tariff(borrowed, 600)("init", 0).flags
    assert "rospy nodes on rpi4-cortex-a72 are charged with roscpp figures" in flag


def test_a_doubtful_figure_is_flagged_where_it_counts() -> None:
    assert "probably a slip" in Tariff(law(ARM), 1500)("advertise_service", 0).flags[0]
    assert Tariff(law(ARM), 600)("advertise_service", 0).flags == ()


def test_prices_are_plain_integers() -> None:
    price = Tariff(law(ARM), 1234.5)("publish", 2)
    assert isinstance(price, Price)
    assert all(type(part) is int for part in price[:2])


MEASURED = """
processors:
  here:
    description: a computer that was measured
    source: a campaign
    cores: 2
    least_mhz: 2600
    greatest_mhz: 2600
    ros:
      rospy:
        client: rospy
        provenance: measured
        source: a campaign
        error: 0.1
        least_mhz: 2600
        greatest_mhz: 2600
        calls:
          publish:
            provenance: measured
            source: a campaign
            constant: {offset: 90000}
            per_x: {offset: 60000}
            caller: {offset: 50000}
            caller_per_x: {offset: 20000}
          receive: {provenance: measured, source: a campaign, constant: {offset: 150000}}
          wait: {provenance: measured, source: a campaign, constant: {offset: 0}, per_x: {offset: 0.6}}
"""


def measured_law(client: str) -> RosLaw:
    return parse_catalogue(MEASURED).processor("here").ros_law(client)


def test_a_measured_part_of_the_caller_takes_precedence() -> None:
    price = Tariff(measured_law("rospy"), 2600)("publish", 3)
    assert (price.caller, price.background) == (50000 + 3 * 20000, 40000 + 3 * 40000)


def test_background_events_are_charged_where_there_are_figures() -> None:
    law = measured_law("rospy")
    assert Tariff(law, 2600)("receive", 0) == Price(0, 150000)
    assert Tariff(law, 2600)("wait", 1e6) == Price(0, 600000)
    assert Tariff(law, 2600)("accept", 0) == Price(0, 0)
    assert Tariff(load_catalogue().processor(INTEL).ros_law("roscpp"), 3000)("receive", 0) == Price(0, 0)


def test_a_law_of_one_frequency_is_flagged_at_another() -> None:
    assert measured_law("rospy").warnings(2600) == ()
    [warning] = measured_law("rospy").warnings(1300)
    assert "1300" in warning
    assert "extrapolated" in warning


def test_a_client_without_a_law_gets_a_hint() -> None:
    with pytest.raises(EstimateError, match="volery cost calibrate ros --client rclpy"):
        measured_law("rclpy")


def test_a_warm_publish_costs_the_same_without_a_separate_figure() -> None:
    paper, mine = law(INTEL), measured_law("rospy")
    assert Tariff(paper, 3000)("publish", 3, FOLLOWING) == Tariff(paper, 3000)("publish", 3)
    assert Tariff(mine, 2600)("publish", 3, FOLLOWING) == Tariff(mine, 2600)("publish", 3)
    text = MEASURED + "          publish_next: {provenance: measured, source: s, constant: {offset: 7000}}\n"
    apart = Tariff(parse_catalogue(text).processor("here").ros_law("rospy"), 2600)("publish", 3, FOLLOWING)
    assert (apart.caller, apart.background) == (7000, 0)
    often = Tariff(parse_catalogue(text).processor("here").ros_law("rospy"), 2600)
    assert often("publish", 3, Warmth(follows=True, often=True)) == apart
    assert often("publish", 3, Warmth(often=True)) == often("publish", 3)


def test_service_requests_cost_what_a_law_states_and_nothing_where_it_has_no_figure() -> None:
    plain = law(INTEL)
    assert Tariff(plain, 3000)("serve", 0) == Tariff(plain, 3000)("call_service", 0) == Price(0, 0)
    figures = plain.calls["init"].model_copy(update={"points": {1600.0: 730_000.0, 3000.0: 730_000.0}})
    priced = plain.model_copy(update={"calls": {**plain.calls, "serve": figures}})
    assert Tariff(priced, 3000)("serve", 0).caller == 730_000
