"""Messages of several topics that belong together: of the same stamp, or of nearly the same."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

from volery.base.time import Ns, from_seconds
from volery.ros.client_libraries.message_filters.filters import SimpleFilter

Queue = dict[Ns, Any]
"""Messages that wait, by their stamps."""


class TimeSynchronizer(SimpleFilter):
    """Hands on one message of each input once all of the same stamp are there."""

    def __init__(self, fs: Sequence[SimpleFilter], queue_size: int) -> None:
        super().__init__()
        self.queue_size = queue_size
        self.allow_headerless = False
        self.connectInput(fs)

    def connectInput(self, fs: Sequence[SimpleFilter]) -> None:
        """Synchronise these."""
        self.node = next((one.node for one in fs if one.node is not None), None)
        self.queues: list[Queue] = [{} for _ in fs]
        self.input_connections = [
            one.registerCallback(self.add, queue, index)
            for index, (one, queue) in enumerate(zip(fs, self.queues, strict=True))
        ]

    def add(self, msg: Any, my_queue: Queue, my_queue_index: int | None = None) -> None:
        """A message of one input is there."""
        stamp = self.stamp_of(msg, self.allow_headerless)
        if stamp is None:
            return
        my_queue[stamp] = msg
        while len(my_queue) > self.queue_size:
            del my_queue[min(my_queue)]
        self._match(stamp, my_queue)

    def _match(self, stamp: Ns, new: Queue) -> None:
        if all(stamp in queue for queue in self.queues):
            self._hand_on([stamp] * len(self.queues))

    def _hand_on(self, stamps: Sequence[Ns]) -> None:
        """The messages of these stamps, one of each input, which wait no longer."""
        self.signalMessage(*[queue.pop(stamp) for queue, stamp in zip(self.queues, stamps, strict=True)])


class ApproximateTimeSynchronizer(TimeSynchronizer):
    """Hands on one message of each input whose stamps are less than *slop* seconds apart.

    With a new message it looks at those of the other inputs that are at most *slop* from it, the nearest
    first; the first set that is near enough as a whole it is.
    """

    def __init__(
        self,
        fs: Sequence[SimpleFilter],
        queue_size: int,
        slop: float,
        allow_headerless: bool = False,
    ) -> None:
        super().__init__(fs, queue_size)
        self.slop: Ns = from_seconds(slop)
        self.allow_headerless = allow_headerless

    def _match(self, stamp: Ns, new: Queue) -> None:
        near = [
            [stamp] if queue is new else sorted(self._near(queue, stamp), key=lambda at: abs(at - stamp))
            for queue in self.queues
        ]
        for stamps in product(*near):
            if max(stamps) - min(stamps) < self.slop or len(set(stamps)) == 1:
                self._hand_on(stamps)
                return

    def _near(self, queue: Queue, stamp: Ns) -> list[Ns]:
        return [at for at in queue if abs(at - stamp) <= self.slop]
