"""The process that a run with C++ components lives in: what it raises, how it dies, what it shows."""

from __future__ import annotations

import os
import signal
from typing import Any

import pytest

from volery.base.errors import LinkSilent, UsageError, VoleryError
from volery.components.cpp.build import build_framework
from volery.run.supervision import Supervision, run_supervised

pytestmark = pytest.mark.integration


def _supervised(work: Any, show: Any = None) -> tuple[Any, list[tuple[str, str]]]:
    mourned: list[tuple[str, str]] = []

    def salvage(error: VoleryError, blamed: str) -> Any:
        mourned.append((blamed, str(error)))

    return run_supervised(work, show, None, Supervision(build_framework(), {}, 5.0), salvage), mourned


def test_the_result_of_the_run_is_returned():
    shown: list[Any] = []

    def work(show: Any, tell: Any) -> Any:
        show("half of it")
        return {"pid": os.getpid()}

    result, mourned = _supervised(work, shown.append)
    assert result["pid"] != os.getpid()
    assert shown == ["half of it"]
    assert not mourned


@pytest.mark.parametrize("error", [UsageError("no such thing"), LinkSilent("no reply")])
def test_an_error_of_the_run_is_raised(error):
    def work(show: Any, tell: Any) -> Any:
        raise error

    with pytest.raises(type(error), match=str(error)):
        _supervised(work)


@pytest.mark.parametrize(
    ("end", "said"),
    [
        (lambda: os._exit(9), "exit status 9"),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), "SIGKILL"),
        (lambda: os.kill(os.getpid(), signal.SIGSEGV), "SIGSEGV"),  # not a component's doing
    ],
)
def test_a_process_that_dies_is_reported(end, said):
    _, mourned = _supervised(lambda show, tell: end())
    [(blamed, error)] = mourned
    assert blamed == "run"
    assert said in error


def _wait_for_ever() -> None:
    while True:
        signal.pause()  # returns at any signal, such as those of the supervision


def test_ctrl_c_is_passed_on():
    parent = os.getpid()

    def work(show: Any, tell: Any) -> Any:
        try:
            os.kill(parent, signal.SIGINT)
            _wait_for_ever()
        except KeyboardInterrupt:
            return "interrupted"

    result, _ = _supervised(work)
    assert result == "interrupted"


def test_ctrl_c_during_the_fork_is_passed_on():
    parent, pending = os.getpid(), [signal.SIGINT]

    def interrupt() -> None:
        if pending and os.getpid() == parent:  # a hook cannot be removed
            os.kill(parent, pending.pop())

    os.register_at_fork(after_in_parent=interrupt)
    with pytest.raises(KeyboardInterrupt):
        _supervised(lambda show, tell: _wait_for_ever())
