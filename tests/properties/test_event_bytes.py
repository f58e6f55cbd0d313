"""Any event whatever comes back from its bytes."""

from math import isnan
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from volery.trace.encoding import OWN_EVENTS, EventCodec, _annotation

_VALUES: dict[str, st.SearchStrategy[Any]] = {
    "Ns": st.integers(-(2**63), 2**63 - 1),
    "int": st.integers(-(2**31), 2**31 - 1),
    "float": st.floats(),
    "bool": st.booleans(),
    "str": st.text(st.characters(exclude_categories=("Cs",)), max_size=40),
}
_CODECS = {kind: EventCodec(kind) for kind in OWN_EVENTS}


def events(kind: type[Any]) -> st.SearchStrategy[Any]:
    return st.builds(kind, *(_VALUES[_annotation(kind, name)] for name in kind._fields))


def same(one: Any, other: Any) -> bool:
    return one == other or (isinstance(one, float) and isnan(one) and isnan(other))


@given(st.one_of([events(kind) for kind in OWN_EVENTS]))
def test_round_trip(event: Any) -> None:
    codec = _CODECS[type(event)]
    data = codec.encode(event)
    assert len(data) % 4 == 0
    again = codec.decode(data)
    assert type(again) is type(event)
    assert all(same(one, other) for one, other in zip(event, again, strict=True))
