"""The longest times of a run after its start-up, to stand beside bounds.

The start-up of a node (its connections, its first messages) is not part of a bound. It is over when every
component has ended its first activation and all that was released before has ended, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from volery.base.time import Ns
from volery.requirements.ledgers import ChainLedger
from volery.trace.events import Activation, Message
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import OpenTrace


@dataclass(frozen=True)
class LongestTimes:
    """Longest response time by component and longest latency by chain, ns, after ``started``."""

    started: Ns
    responses: dict[str, Ns]
    chains: dict[str, Ns]


def longest_times(folder: Path) -> LongestTimes:
    """Read the longest times from the trace of a run folder.

    Raises:
        UsageError: There is no trace, or it cannot be read.
    """
    with OpenTrace(folder / TRACE_FILE) as reading:
        components = {component.name for component in reading.setup.components}
        chains = [ChainLedger(chain) for chain in reading.setup.chains]
        activations: list[Activation] = []
        messages: list[Message] = []
        for event in reading.events((Activation, Message)):
            if isinstance(event, Activation):
                if event.component in components:  # not what makes vehicles safe at the end
                    activations.append(event)
            elif isinstance(event, Message):
                messages.append(event)
    started = _started(activations)
    responses: dict[str, Ns] = {}
    for one in activations:
        if one.released >= started:
            longest = responses.get(one.component, 0)
            responses[one.component] = max(longest, one.finished - one.released)
    for message in messages:
        if message.sent >= started:
            for chain in chains:
                chain.message(message)
    latencies = {chain.setup.name: chain.latencies.largest for chain in chains if chain.latencies.count}
    return LongestTimes(started, responses, latencies)


def _started(activations: Sequence[Activation]) -> Ns:
    """Return when the start-up is over."""
    first: dict[str, Ns] = {}
    for one in activations:
        first.setdefault(one.component, one.finished)
    started = max(first.values(), default=0)
    for one in sorted(activations, key=lambda each: each.released):
        if one.released >= started:
            break
        started = max(started, one.finished)
    return started
