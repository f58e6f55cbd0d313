"""What recording costs: microseconds an event for each tap, as a ratio to the mcap library's own writer.

The library is handed bytes that are ready; ours has to make them. Rounds take turns; figures are medians.

    python bench/recording.py [--quick]
"""

from __future__ import annotations

import argparse
import gc
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter

from mcap.writer import CompressionType, Writer

from volery.report.digest import Digest
from volery.requirements.accounts import Accounts
from volery.testing.sample_run import sample_events, sample_setup
from volery.trace.encoding import OWN_EVENTS, EventCodec, type_name
from volery.trace.events import Event, Published, Slice
from volery.trace.mcap_writer import McapWriter
from volery.trace.reader import OpenTrace
from volery.trace.timeline import TimelineWriter


def library(path: Path, events: Sequence[Event]) -> Callable[[], None]:
    """The same messages through the library, encoded beforehand."""
    codecs = {kind: EventCodec(kind) for kind in OWN_EVENTS}
    encoded = [codecs[type(event)].encode(event) for event in events]

    def write() -> None:
        with path.open("wb") as file:
            writer = Writer(file, compression=CompressionType.NONE)
            writer.start("ros2", "bench")
            schema = writer.register_schema(
                type_name(Slice), "ros2msg", EventCodec(Slice).definition.encode()
            )
            channel = writer.register_channel("/events", "cdr", schema)
            for number, data in enumerate(encoded):
                writer.add_message(channel, number, data, number)
            writer.finish()

    return write


def mcap_writer(path: Path, events: Sequence[Event]) -> Callable[[], None]:
    def write() -> None:
        writer = McapWriter(path, sample_setup())
        for event in events:
            writer(event)
        writer.close()

    return write


def timeline(path: Path, events: Sequence[Event]) -> Callable[[], None]:
    def write() -> None:
        writer = TimelineWriter(path)
        for event in events:
            writer(event)
        writer.close()

    return write


def fold(make: Callable[[], Callable[[Event], None]], events: Sequence[Event]) -> Callable[[], None]:
    def run() -> None:
        tap = make()
        for event in events:
            tap(event)

    return run


def reader(path: Path) -> Callable[[], None]:
    def run() -> None:
        with OpenTrace(path) as reading:
            for _ in reading.events():
                pass

    return run


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="one short round")
    quick = parser.parse_args().quick
    seconds = 60.0 if quick else 600.0
    events = [event for event in sample_events(seconds=seconds) if not isinstance(event, Published)]
    with TemporaryDirectory() as name:
        folder = Path(name)
        setup = sample_setup()
        trace = folder / "ours.mcap"
        candidates = {
            "mcap library, bytes ready": library(folder / "theirs.mcap", events),
            "trace.mcap": mcap_writer(trace, events),
            "timeline.json": timeline(folder / "timeline.json", events),
            "accounts": fold(lambda: Accounts(setup), events),
            "digest of the report": fold(lambda: Digest(setup, None), events),
        }
        candidates["reading it again"] = reader(trace)
        times: dict[str, list[float]] = {what: [] for what in candidates}
        for _ in range(1 if quick else 5):
            for what, action in candidates.items():
                gc.collect()
                start = perf_counter()
                action()
                times[what].append(perf_counter() - start)
        size = trace.stat().st_size
    reference = median(times["mcap library, bytes ready"])
    print(f"{len(events)} events of {seconds:.0f} simulated seconds")
    for what, found in times.items():
        taken = median(found)
        print(
            f"{what:28} {1e6 * taken / len(events):6.2f} us an event  {taken / reference:5.2f} x the library"
        )
    hourly = size / seconds * 3600 / 1e6
    print(f"trace: {size / len(events):.0f} bytes an event, {hourly:.0f} MB a simulated hour")


if __name__ == "__main__":
    main()
