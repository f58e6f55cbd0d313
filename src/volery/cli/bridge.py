"""``volery bridge``: a vehicle on a real ROS graph."""

from __future__ import annotations

import signal

from volery.base.time import S, clock
from volery.cli.console import Output
from volery.cli.endings import OK
from volery.run.bridge import Bridge, BridgeOptions
from volery.trace.events import Event, LinkState, Text


class Told:
    """Says what happens, each thing when it changes."""

    def __init__(self, output: Output) -> None:
        self._output = output
        self._last = ""

    def record(self, event: Event) -> None:
        """Links that come and go, and warnings."""
        if isinstance(event, LinkState):
            self._output.note(f"{clock(event.at)}  link {event.state}: {event.detail}")
        elif isinstance(event, Text):
            self._output.note(f"{clock(event.at)}  {event.text}")

    def status(self, now: int, text: str) -> None:
        """Whom it hears, in which mode."""
        if text != self._last:
            self._last = text
            self._output.note(f"{clock(now)}  {text}")


def bridge(output: Output, wanted: BridgeOptions) -> int:
    """Bridge until told to stop; the exit status."""
    told = Told(output)
    made = Bridge(wanted, told.record)
    below = made.namespace.rstrip("/")
    output.show(
        f"bridging {wanted.url} to {wanted.graph} under {made.names}'s names, {below}/...; Ctrl-C stops it"
    )
    made.every(S, lambda: told.status(made.kernel.now(), made.status))
    signal.signal(signal.SIGTERM, lambda number, frame: signal.raise_signal(signal.SIGINT))  # of a service
    try:
        made.run()
    except KeyboardInterrupt:
        output.note("stopped")
    return OK
