"""The timeline is trace-event JSON whose times are exact."""

import json
from pathlib import Path
from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import S
from volery.testing.sample_run import sample_events
from volery.trace.events import NONE, Activation, Call, Event, Failure, Message, Milestone, Slice, Text
from volery.trace.timeline import TimelineWriter


def timeline(path: Path, *events: Event) -> list[dict[str, Any]]:
    writer = TimelineWriter(path)
    for event in events:
        writer(event)
    writer.close()
    writer.close()
    found: list[dict[str, Any]] = json.loads(path.read_text())
    return found


def test_a_slice_is_an_event_of_a_core_of_a_processor(tmp_path: Path) -> None:
    process, thread, found = timeline(
        tmp_path / "t", Slice(1_234_567, 2_000_001, "onboard", 3, "loop", "control")
    )
    assert process["args"] == {"name": "onboard"}
    assert thread["args"] == {"name": "core 3"}
    assert found["name"] == "control/loop"
    assert (found["ph"], found["ts"], found["dur"]) == ("X", 1234.567, 765.434)
    assert (found["pid"], found["tid"]) == (thread["pid"], thread["tid"])


def test_slices_without_a_gap_are_one(tmp_path: Path) -> None:
    found = timeline(
        tmp_path / "t",
        Slice(0, 1000, "p", 0, "t", "c"),
        Slice(1000, 3000, "p", 0, "t", "c"),
        Slice(0, 9000, "p", 1, "t", "c"),
        Slice(3000, 4000, "p", 0, "u", "c"),
        Slice(5000, 6000, "p", 0, "u", "c"),
    )
    spans = [(event["name"], event["ts"], event["dur"]) for event in found if event["ph"] == "X"]
    assert sorted(spans) == [("c/t", 0, 3), ("c/t", 0, 9), ("c/u", 3, 1), ("c/u", 5, 1)]


def test_calls_that_overlap_stay_apart(tmp_path: Path) -> None:
    found = timeline(
        tmp_path / "t",
        Call(0, 5000, "a", "central", "order", "ok"),
        Call(2000, 7000, "b", "central", "order", "Refused"),
    )
    spans = [event for event in found if event["ph"] in "be"]
    assert [(event["ph"], event["id"], event["ts"]) for event in spans] == [
        ("b", 1, 0.0),
        ("e", 1, 5.0),
        ("b", 2, 2.0),
        ("e", 2, 7.0),
    ]
    assert spans[2]["args"] == {"caller": "b", "outcome": "Refused"}


def test_a_state_lasts_until_the_next_one_and_the_last_until_the_end(tmp_path: Path) -> None:
    found = timeline(
        tmp_path / "t",
        Milestone(1 * S, "c", "parcel", "p1", "ordered", ""),
        Milestone(3 * S, "c", "parcel", "p1", "delivered", ""),
        Activation(3 * S, 4 * S, "c", -1),
    )
    states = [(event["name"], event["ts"], event["dur"]) for event in found if event["ph"] == "X"]
    assert states == [("ordered", 1e6, 2e6), ("delivered", 3e6, 1e6)]


def test_a_failure_marks_the_whole_timeline(tmp_path: Path) -> None:
    *_, mark = timeline(tmp_path / "t", Failure(S, 'the "best"', "gone"))
    assert (mark["ph"], mark["s"], mark["name"]) == ("i", "g", 'failure of the "best"')


def test_a_run_with_nothing_to_show_is_still_json(tmp_path: Path) -> None:
    assert timeline(tmp_path / "t", Text(0, "a", 6, "b")) == []


def test_the_sample_run_is_whole_and_the_same_each_time(tmp_path: Path) -> None:
    found = timeline(tmp_path / "a", *sample_events(seconds=60.0))
    timeline(tmp_path / "b", *sample_events(seconds=60.0))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    assert all(event["dur"] >= 0 for event in found if event["ph"] == "X")
    assert sum(event["ph"] == "b" for event in found) == sum(event["ph"] == "e" for event in found)


def test_a_killed_writer_leaves_what_the_format_calls_an_open_array(tmp_path: Path) -> None:
    path = tmp_path / "t"
    writer = TimelineWriter(path)
    for event in sample_events(seconds=120.0):
        writer(event)
    assert json.loads(path.read_text() + "]")
    writer.close()


def test_a_missing_folder_is_a_usage_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot write"):
        TimelineWriter(tmp_path / "none" / "t")


def test_a_full_disk_is_a_problem_not_an_exception(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    writer = TimelineWriter(full)
    for event in sample_events(seconds=60.0):
        writer(event)
    writer.close()
    assert "No space left" in writer.problem


def test_a_message_that_took_time_has_the_names_of_its_ends(tmp_path: Path) -> None:
    found = timeline(
        tmp_path / "t",
        Message(1000, 4500, "/pose", "/talker", "/listener", 60),
        Message(2000, 2000, "/pose", "/talker", "/beside", 60),
        Message(3000, NONE, "/pose", "/talker", "/gone", 60),
    )
    begin, end = (event for event in found if event["ph"] in "be")
    assert (begin["name"], begin["ts"], end["ts"], begin["id"]) == ("/pose", 1.0, 4.5, end["id"])
    assert begin["args"] == {
        "from": "/talker", "to": "/listener", "bytes": 60, "begin": "rclcpp_publish", "end": "rclcpp_take",
    }  # fmt: skip
