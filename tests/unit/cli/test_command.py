"""A Ctrl-C that strikes where nothing can be raised is not lost; commands share options."""

import signal
import sys
import threading
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from volery.cli.command import Commands, resend_lost_interrupts
from volery.cli.console import CommandOutput


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


@dataclass(frozen=True, kw_only=True)
class Shared:
    """Options of two commands."""

    height: Annotated[float, typer.Option(help="Height.")]
    way: Annotated[str, typer.Option(help="Way.")] = "straight"


def test_the_fields_of_a_dataclass_are_options():
    commands, seen = Commands(), []

    @commands.add("quiet")
    def climb(output: CommandOutput, shared: Shared, name: str = "one") -> int:
        """Climb."""
        seen.append((shared, name))
        return 0

    @commands.add("quiet")
    def descend(output: CommandOutput, shared: Shared) -> int:
        """Descend."""
        seen.append(shared)
        return 0

    app = typer.Typer()
    commands.add_to(app)
    runner = CliRunner()
    assert runner.invoke(app, ["climb", "--height", "3", "--name", "two"]).exit_code == 0
    assert runner.invoke(app, ["descend", "--height", "1", "--way", "steep"]).exit_code == 0
    assert seen == [(Shared(height=3.0), "two"), Shared(height=1.0, way="steep")]
    assert runner.invoke(app, ["descend"]).exit_code == 2
