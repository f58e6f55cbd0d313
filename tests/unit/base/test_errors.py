from __future__ import annotations

import pytest

from volery.base import errors
from volery.base.errors import ComponentError, Location, ModelError, NotArrived, choices, did_you_mean


@pytest.mark.parametrize(
    ("names", "text"),
    [([], "nothing"), (["b"], "b"), (["b", "a"], "a or b"), (["c", "a", "b"], "a, b or c")],
)
def test_choices_read_as_a_sentence(names: list[str], text: str) -> None:
    assert choices(names) == text


def test_a_slip_is_recognised_and_a_stranger_is_not() -> None:
    assert did_you_mean("frequncy", ["frequency", "cores"]) == " (did you mean 'frequency'?)"
    assert did_you_mean("zzz", ["frequency", "cores"]) == ""


def test_a_model_error_says_file_line_path_and_what() -> None:
    error = ModelError("no such processor", "allocations.fast.central", Location("system.yaml", 12))
    assert str(error) == "system.yaml:12: allocations.fast.central: no such processor"
    assert str(ModelError("empty")) == "empty"


def test_errors_name_the_offender() -> None:
    assert str(ComponentError("central", "it raised")) == "central: it raised"
    assert (
        str(NotArrived("drone_1", "take-off to 10 m", "still at 2 m"))
        == "drone_1: take-off to 10 m: still at 2 m"
    )


def test_everything_raised_on_purpose_is_one_tree() -> None:
    raised = [
        each for each in vars(errors).values() if isinstance(each, type) and issubclass(each, Exception)
    ]
    assert len(raised) > 10
    assert all(issubclass(each, errors.VoleryError) for each in raised)
