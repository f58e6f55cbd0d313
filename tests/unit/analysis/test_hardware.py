"""The price of a model's hardware: every part as often as it is there, by the model or by the catalogue."""

import pytest

from volery.analysis.hardware import hardware, hardware_price
from volery.base.errors import ModelError
from volery.cost import load_catalogue
from volery.model.system_loader import load
from volery.run.assembly.model_checks import vocabulary

MODEL = """\
volery: 1
name: priced
platform:
  processors:
    ground: {is: rpi5-cortex-a76, frequency: 2400 MHz}
    onboard: {is: rpi4-cortex-a72, frequency: 1500 MHz, carried_by: drone}
  networks:
    radio: {between: [ground, onboard], bandwidth: 57600 bit/s}
environment:
  vehicles:
    drone:
      {kind: multirotor, autopilot: ardupilot, at: {east: 0 m}, count: 2,
       battery: {capacity: 5 Ah, voltage: 11.1 V}}
"""
ONBOARD = "platform.processors.onboard.price"


@pytest.fixture
def priced(tmp_path):
    file = tmp_path / "model.yaml"
    file.write_text(MODEL)
    return lambda *changes: hardware(load(file, vocabulary(), overrides=changes))


def test_every_part_is_counted_as_often_as_it_is_there(priced):
    parts = priced()
    assert [one.what for one in parts] == [
        "rpi5-cortex-a76",
        "rpi4-cortex-a72",
        "rpi4-cortex-a72",
        "3 radios",
        *(("multirotor", "battery of 56 Wh") * 2),
    ]
    assert hardware_price(parts) == {"USD": pytest.approx(60 + 2 * 55 + 3 * 50 + 2 * (600 + 55.5))}
    assert [one.estimated for one in parts[:4]] == [False, False, False, True]


def test_the_model_states_its_own_prices_and_currencies_are_not_converted(priced):
    changes = (
        f"{ONBOARD}={{amount: 75 USD, year: 2020, source: with 8 GB}}",
        "environment.vehicles.drone.price=1200 EUR",
        "environment.vehicles.drone.battery.price=60 EUR",
        "platform.networks.radio.price=20 EUR",
    )
    parts = priced(*changes)
    assert (parts[1].amount, parts[1].year, parts[1].source) == (75.0, 2020, "with 8 GB")
    assert not parts[1].estimated
    assert hardware_price(parts) == {"USD": 60 + 2 * 75, "EUR": 3 * 20 + 2 * 1260}


def test_a_price_without_currency_is_refused(priced):
    with pytest.raises(ModelError, match=r"onboard\.price.*an amount with its currency, such as 55 USD"):
        priced(f"{ONBOARD}=75")


def test_all_hardware_of_the_catalogue_has_a_price_with_its_source():
    catalogue = load_catalogue()
    for entry in (*catalogue.processors.values(), *catalogue.hardware.values()):
        assert entry.price is not None
        assert entry.price.source
    assert all(entry.supply is not None for entry in catalogue.processors.values())


def test_a_catalogue_of_the_user_changes_a_price(tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text(
        "hardware:\n  radio:\n    price: {amount: 9, currency: EUR, year: 2024, source: our shop}\n"
        "processors: {}\n"
    )
    assert load_catalogue(file).hardware["radio"].price.amount == 9
    assert load_catalogue().hardware["radio"].price.amount == 50
