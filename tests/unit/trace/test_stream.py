"""The stream passes every event to the listeners of its kind, in the order in which they were added."""

from typing import Any

from volery.trace.events import Event, Failure, Record, Text
from volery.trace.stream import Stream

WORDS = Text(1, "a", 6, "b")
FAILURE = Failure(2, "a", "b")


class TextsOnly:
    def __init__(self) -> None:
        self.received: list[Event] = []

    def __call__(self, event: Event) -> None:
        raise AssertionError("a selective listener receives events by its own function")

    def listener(self, kind: type[Any]) -> Record | None:
        return self.received.append if kind is Text else None


def test_listeners_receive_events_in_turn() -> None:
    received: list[tuple[str, Event]] = []
    stream = Stream()
    stream.tap(lambda event: received.append(("first", event)))
    stream.tap(lambda event: received.append(("second", event)))
    stream(WORDS)
    stream(FAILURE)
    assert received == [("first", WORDS), ("second", WORDS), ("first", FAILURE), ("second", FAILURE)]


def test_the_choosy_hear_what_they_chose() -> None:
    tap = TextsOnly()
    stream = Stream()
    stream.tap(tap)
    stream(WORDS)
    stream(FAILURE)
    assert tap.received == [WORDS]


def test_a_tap_that_comes_late_hears_from_then_on() -> None:
    received: list[Event] = []
    stream = Stream()
    stream(WORDS)
    stream.tap(received.append)
    stream(WORDS)
    assert received == [WORDS]


def test_a_guarded_tap_that_fails_is_removed_and_the_others_receive_everything() -> None:
    received: list[Event] = []
    failures: list[Exception] = []

    def fail(event: Event) -> None:
        raise ValueError("wrong")

    stream = Stream()
    stream.tap_guarded(fail, failures.append)
    stream.tap(received.append)
    stream(WORDS)
    stream(FAILURE)
    assert received == [WORDS, FAILURE]
    assert [str(error) for error in failures] == ["wrong"]
