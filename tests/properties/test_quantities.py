"""Units and changes hold for whatever is written."""

import json
import string
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.base.errors import Location, VoleryError
from volery.base.units import PLAIN, TIME, UNITS, QuantityError, parse, read, read_ns, unit
from volery.model.assembly import Change, apply_changes, change_from_option, split_path
from volery.model.text import Problems, TextNode, parse_value
from volery.model.text import parse as parse_text

SYMBOLS = st.sampled_from(sorted(UNITS))
NUMBERS = st.decimals(allow_nan=False, allow_infinity=False, places=6, min_value=-(10**9), max_value=10**9)
WORDS_OF_YAML = ("null", "true", "false")
NAMES = st.text(string.ascii_lowercase + "_", min_size=1, max_size=8).filter(
    lambda name: name not in WORDS_OF_YAML
)
HERE = Location("here", 1)


def refusal(attempt, error, otherwise):
    """The words in which *attempt* is refused; any other exception is a fault. *otherwise* if it is not."""
    try:
        attempt()
    except error as refused:
        return str(refused)
    return otherwise


@given(NUMBERS, SYMBOLS)
def test_a_number_and_its_unit_are_what_was_written(number, symbol):
    quantity = parse(f"{number:f} {symbol}")
    assert quantity.value == Fraction(number) * UNITS[symbol].value
    assert quantity.dimension == UNITS[symbol].dimension


@given(SYMBOLS, SYMBOLS)
def test_a_quotient_of_units_undoes_a_product(one, other):
    assert unit(f"{one}*{other}/{other}") == unit(one)
    assert unit(f"{one}/{one}").dimension == PLAIN


@given(st.integers(min_value=0, max_value=10**18))
def test_nanoseconds_come_back_as_they_are(ns):
    assert read_ns(f"{ns} ns") == ns


@given(st.text(max_size=30))
def test_any_text_is_a_quantity_or_refused(text):
    assert "a time such as" in refusal(lambda: read(text, TIME), QuantityError, "a time such as")


VALUES = st.recursive(
    st.integers() | st.booleans() | st.text(string.ascii_letters + string.digits + " .:/", max_size=10),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=6,
)


def tree(value):
    if isinstance(value, dict):
        return TextNode({key: tree(inner) for key, inner in value.items()}, HERE)
    if isinstance(value, list):
        return TextNode([tree(inner) for inner in value], HERE)
    return TextNode(value, HERE)


@given(NAMES, NAMES, VALUES, VALUES)
def test_what_is_set_is_there_and_nothing_else_changes(name, other, old, new):
    parameters = {name: old, other: old} if name != other else {name: old}
    root = tree({"components": {"c": {"language": "python", "parameters": parameters}}})
    problems = Problems(root.locate)
    apply_changes(root, [Change(("components", "c", "parameters", name), tree(new))], problems)
    assert not problems
    found = root.plain()["components"]["c"]["parameters"]
    assert found[name] == tree(new).plain()
    assert {key: value for key, value in found.items() if key != name} == {
        key: tree(value).plain() for key, value in parameters.items() if key != name
    }


@given(NAMES, VALUES)
def test_setting_twice_is_setting_once(name, value):
    once, twice = tree({"run": {}}), tree({"run": {}})
    change = Change(("environment", "vehicles", name), tree(value))
    apply_changes(once, [change], Problems(once.locate))
    apply_changes(twice, [change, change], Problems(twice.locate))
    assert once.plain() == twice.plain()


@given(st.text(string.ascii_letters + ".=_ '{}[]:,-0123456789", max_size=40))
def test_any_option_is_read_or_refused_in_words(text):
    assert text in refusal(lambda: change_from_option(text), VoleryError, text)


@given(NAMES, NAMES, VALUES)
def test_a_right_option_is_read(first, second, value):
    change = change_from_option(f"{first}.{second}={json.dumps(value)}")
    assert change.path == (first, second)
    assert change.value.plain() == value
    assert str(change.where).startswith(f"--set {first}.{second}=")


@given(st.text(max_size=200))
def test_any_text_is_yaml_or_refused_with_a_line(text):
    assert refusal(lambda: parse_text(text, "any.yaml"), VoleryError, "any.yaml:").startswith("any.yaml:")


def test_a_list_item_can_be_set():
    root = tree({"platform": {"networks": {"n": {"between": ["a", "b"]}}}})
    apply_changes(
        root,
        [Change(split_path("platform.networks.n.between.1"), parse_value("c", HERE))],
        Problems(root.locate),
    )
    assert root.plain()["platform"]["networks"]["n"]["between"] == ["a", "c"]


@pytest.mark.parametrize("value", ["", "null", "~"])
def test_nothing_takes_away(value):
    root = tree({"scenarios": {"calm": {"set": {}}, "windy": {}}})
    apply_changes(
        root, [Change(split_path("scenarios.calm"), parse_value(value, HERE))], Problems(root.locate)
    )
    assert root.plain() == {"scenarios": {"windy": {}}}
