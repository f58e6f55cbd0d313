"""A Ctrl-C that strikes where nothing can be raised is not lost."""

import signal
import sys
import threading
from types import SimpleNamespace

import pytest

from volery.cli.command import resend_lost_interrupts


@pytest.fixture
def struck():
    """Set when SIGINT arrives."""
    event = threading.Event()
    before = signal.signal(signal.SIGINT, lambda number, frame: event.set())
    yield event
    signal.signal(signal.SIGINT, before)


def lost(error):
    return SimpleNamespace(exc_type=error, exc_value=None, exc_traceback=None, err_msg=None, object=None)


def test_a_lost_interrupt_comes_again(struck):
    with resend_lost_interrupts():
        sys.unraisablehook(lost(KeyboardInterrupt))
    assert struck.wait(30)


def test_other_errors_reach_the_usual_hook(monkeypatch, struck):
    reported = []
    monkeypatch.setattr(sys, "unraisablehook", reported.append)
    fault = lost(ValueError)
    with resend_lost_interrupts():
        sys.unraisablehook(fault)
    assert reported == [fault]
    assert sys.unraisablehook == reported.append
    assert not struck.is_set()
