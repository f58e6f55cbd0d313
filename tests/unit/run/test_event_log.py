"""The log file of a run: which lines it has, at which level, and how it fails."""

from pathlib import Path

import pytest

from volery.base.errors import UsageError
from volery.base.time import S
from volery.run.event_log import EventLog, LogOptions, parse_level
from volery.trace.events import Failure, LinkState, Milestone, Operation, Slice, Text, Verdict

NAN = float("nan")
EVENTS = (
    Text(1 * S, "patrol", 7, "nearest post first"),
    Text(2 * S, "patrol", 6, "all is well\nat the gate"),
    Text(3 * S, "drone_1", 4, "battery low"),
    Slice(1, 2, "onboard", 0, "patrol", "patrol"),
    Operation(1 * S, 4 * S, "drone_1", "goto", "goto the gate", "ok", "", 0.1, 0.1, 0.1, 0.1),
    Operation(1 * S, 5 * S, "drone_1", "goto", "goto the pump", "Refused", "no GPS", NAN, NAN, NAN, NAN),
    Milestone(6 * S, "patrol", "post", "gate", "seen", ""),
    LinkState(6 * S, "drone_1", "up", "MAVLink"),
    Failure(7 * S, "patrol", "ValueError: no such post"),
    Verdict(8 * S, "landing", "drone_1.landing_offset", "max", 5.0, NAN, False),
)


def lines(tmp_path, level, events=EVENTS):
    log = EventLog(LogOptions(tmp_path / "log.txt", parse_level(level)))
    for event in events:
        log(event)
    log.outcome(8 * S, "failed", "patrol: ValueError: no such post")
    log.close()
    assert not log.problem
    return (tmp_path / "log.txt").read_text().splitlines()


def test_each_thing_that_happens_is_one_line(tmp_path):
    assert lines(tmp_path, "info") == [
        "0:00:02.000 info    patrol: all is well at the gate",
        "0:00:03.000 warning drone_1: battery low",
        "0:00:04.000 info    drone_1: goto the gate: done",
        "0:00:05.000 warning drone_1: goto the pump: Refused: no GPS",
        "0:00:06.000 info    patrol: post gate: seen",
        "0:00:06.000 info    drone_1: up MAVLink",
        "0:00:07.000 error   patrol: ValueError: no such post",
        "0:00:08.000 error   volery: landing: drone_1.landing_offset was never observed, required is max 5",
        "0:00:08.000 error   volery: failed: patrol: ValueError: no such post",
    ]


@pytest.mark.parametrize(("level", "count"), [("error", 3), ("warning", 5), ("info", 9), ("debug", 10)])
def test_the_level_chooses(tmp_path, level, count):
    assert len(lines(tmp_path, level)) == count


def test_what_is_wrong_with_the_options_is_an_error(tmp_path):
    with pytest.raises(UsageError, match="there is debug, error, info or warning"):
        parse_level("verbose")
    with pytest.raises(UsageError, match="cannot write"):
        EventLog(LogOptions(tmp_path / "missing" / "log.txt"))


def test_a_full_disk_is_a_problem_and_no_exception():
    log = EventLog(LogOptions(Path("/dev/full")))
    log(EVENTS[1])
    log.close()
    assert "No space left" in log.problem
