"""How often garbage is collected during a command or a run."""

import gc

import pytest

from volery.base.garbage import COLLECT_EVERY, seldom_collected


@pytest.fixture(autouse=True)
def restored():
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


def test_collections_are_seldom_and_as_before_afterwards():
    gc.set_threshold(700, 10, 10)
    with seldom_collected():
        assert gc.get_threshold() == (COLLECT_EVERY, 10, 10)
    assert gc.get_threshold() == (700, 10, 10)


@pytest.mark.parametrize("first", [0, COLLECT_EVERY + 1])
def test_a_caller_who_collects_more_seldom_is_left_alone(first):
    gc.set_threshold(first, 5, 5)
    with seldom_collected():
        assert gc.get_threshold() == (first, 5, 5)


def test_the_threshold_is_restored_after_an_error():
    gc.set_threshold(700, 10, 10)
    with pytest.raises(KeyError), seldom_collected():
        raise KeyError
    assert gc.get_threshold() == (700, 10, 10)
