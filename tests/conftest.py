"""For all tests: how fast a machine is, and how busy, is not what they are about; nor who started them."""

import os
import signal
from collections import Counter

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a shell starts what it sends to the background so,
    signal.signal(signal.SIGINT, signal.default_int_handler)  # and programs that tests start would inherit it
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # by nohup; with a handler, programs have the default
    signal.signal(signal.SIGHUP, lambda *_: None)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """One more than there are cores: some tests wait."""
    return len(os.sched_getaffinity(0)) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take long: the longest time-outs, what starts programs, then most tests."""
    files = Counter(item.path for item in items)
    limits, programs = Counter[object](), set()
    for item in items:
        marker = item.get_closest_marker("timeout")
        limits[item.path] = max(limits[item.path], marker.args[0] if marker else 0)
        if item.get_closest_marker("integration"):
            programs.add(item.path)
    items.sort(key=lambda item: (-limits[item.path], item.path not in programs, -files[item.path]))
