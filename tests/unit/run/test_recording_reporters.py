"""Documents that a run makes: the error of a reporter is reported; it does not end the run."""

from pathlib import Path
from typing import Any

import pytest

from volery.requirements.record import RunRecord
from volery.run import recording
from volery.run.recording import Recording
from volery.trace.attachments import RunSetup
from volery.trace.events import Event, Text


class Counting:
    """Counts events and writes their number; the third event is too much for it."""

    def __init__(self, setup: RunSetup, attachments: Any) -> None:
        self.events = 0

    def __call__(self, event: Event) -> None:
        self.events += 1
        if self.events == 3:
            raise ZeroDivisionError("three")

    def write(self, record: RunRecord, folder: Path) -> Path:
        path = folder / "count.txt"
        path.write_text(f"{self.events}")
        return path


@pytest.mark.parametrize(("events", "fails"), [(2, False), (4, True)])
def test_a_reporter_receives_events_and_its_error_is_a_problem_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, events: int, fails: bool
) -> None:
    monkeypatch.setitem(recording.reporters._added, "count", Counting)
    made = Recording(RunSetup(), tmp_path)
    for number in range(events):
        made.stream(Text(number, "drone", 6, "words"))
    made.finish("completed", "", events, [])
    found = [] if fails else ["2"]
    assert [one.read_text() for one in tmp_path.glob("count.txt")] == found
    problems = ["the report 'count' was not made: ZeroDivisionError: three; the other files are complete"]
    assert made.problems == (problems if fails else [])
    for name in ("trace.mcap", "timeline.json", "run.json", "report.html"):
        assert (tmp_path / name).stat().st_size > 0
