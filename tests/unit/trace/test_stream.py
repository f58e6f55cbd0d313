"""The stream tells every event to whoever wants its kind, in the order of tapping."""

from typing import Any

from volery.trace.events import Event, Failure, Record, Stream, Text

WORDS = Text(1, "a", 6, "b")
FAILURE = Failure(2, "a", "b")


class TextsOnly:
    def __init__(self) -> None:
        self.heard: list[Event] = []

    def __call__(self, event: Event) -> None:
        raise AssertionError("who is choosy is told by the way it chose")

    def listener(self, kind: type[Any]) -> Record | None:
        return self.heard.append if kind is Text else None


def test_everybody_is_told_in_turn() -> None:
    heard: list[tuple[str, Event]] = []
    stream = Stream()
    stream.tap(lambda event: heard.append(("first", event)))
    stream.tap(lambda event: heard.append(("second", event)))
    stream(WORDS)
    stream(FAILURE)
    assert heard == [("first", WORDS), ("second", WORDS), ("first", FAILURE), ("second", FAILURE)]


def test_the_choosy_hear_what_they_chose() -> None:
    tap = TextsOnly()
    stream = Stream()
    stream.tap(tap)
    stream(WORDS)
    stream(FAILURE)
    assert tap.heard == [WORDS]


def test_a_tap_that_comes_late_hears_from_then_on() -> None:
    heard: list[Event] = []
    stream = Stream()
    stream(WORDS)
    stream.tap(heard.append)
    stream(WORDS)
    assert heard == [WORDS]
