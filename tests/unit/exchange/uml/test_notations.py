"""S3D's and MARTE's notations, as people write them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.exchange.uml.notations import figure, properties, tagged, tagged_text


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("$language=C++;", {"language": "C++"}),
        ("$language = roscpp", {"language": "roscpp"}),
        ("$language=Python; $path=a b/c.py;", {"language": "Python", "path": "a b/c.py"}),
        ('$path="src/x.cpp";', {"path": "src/x.cpp"}),
        ("no property; $ = 3", {}),
        ("", {}),
    ],
)
def test_properties_of_a_comment(body, expected):
    assert properties(body) == expected


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("200", "ms", "200 ms"),
        ("200 ms", "", "200 ms"),
        ("(200,ms)", "", "200 ms"),
        ("(value=200,unit=ms)", "", "200 ms"),
        ("(value=5.0,unit=KHz,statQ=mean)", "", "5.0 kHz"),
        ("value = 1e-3; unit = s", "", "1e-3 s"),
        ("(expr=$x,unit=ms,statQ=mean,source=est)", "", None),
        ("null", "", None),
        ("", "ms", None),
        (" \n", "", None),
        ("soon", "", None),
        ("12 Mb_per_s", "", "12 Mbit/s"),
    ],
)
def test_figures(text, unit, expected):
    assert figure(text, unit) == expected


def test_three_times_in_one_text():
    stated = tagged("BOET/MOET/WOET = 1/8/15; unit = ms")
    assert [stated.quantity(one) for one in ("boet", "moet", "woet")] == ["1 ms", "8 ms", "15 ms"]


def test_an_occurrence_has_a_pattern():
    stated = tagged("Periodic (Period = 200; unit = ms)")
    assert (stated.pattern, stated.quantity("period")) == ("periodic", "200 ms")
    stated = tagged("periodic(period=(100,ms), jitter=(2,ms))")
    assert (stated.quantity("period"), stated.quantity("jitter")) == ("100 ms", "2 ms")


def test_times_of_two_units_are_not_one_text():
    with pytest.raises(ValueError, match="one unit is needed"):
        tagged_text({"BOET": "900 us", "WOET": "1 ms"})


@given(st.integers(0, 10**6), st.sampled_from(["ns", "us", "ms", "s", "min"]))
def test_a_time_is_the_same_after_writing(number, unit):
    text = tagged_text({"MOET": f"{number} {unit}"})
    assert tagged(text).quantity("moet") == f"{number} {unit}"


@given(st.text(max_size=60))
def test_no_text_is_fatal(text):
    figure(text)
    properties(text)
    tagged(text)
