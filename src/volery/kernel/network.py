"""Networks between processors: one sender at a time, then latency; a transmission may be lost.

The law, for `size` bytes:

* serialisation time = size * 8 / bandwidth, rounded up to a nanosecond; other senders wait meanwhile;
* arrival = end of serialisation + latency;
* each transmission is lost with probability `loss`: one draw each from the network's own stream, in order;
* a reliable transfer is sent again 2 * latency + serialisation time after the start of a lost transmission.
"""

from __future__ import annotations

from collections import deque
from functools import partial
from typing import TYPE_CHECKING

from volery.base.errors import LinkLost, UsageError
from volery.base.time import Ns, S, to_seconds
from volery.kernel.waiting import current_task
from volery.trace.events import NONE, Transmission

if TYPE_CHECKING:
    from random import Random

    from volery.kernel.api import Action, Handle, Kernel


class Transfer:
    """A reliable transfer in progress; those of one `queue` must arrive in order."""

    __slots__ = ("arrived", "begun", "deliver", "next", "occupied", "queue", "size")

    def __init__(self, begun: Ns, size: int, deliver: Action, queue: deque[Transfer]) -> None:
        self.begun, self.size, self.deliver, self.queue = begun, size, deliver, queue
        self.occupied: Ns = 0
        self.next: Handle | None = None
        self.arrived = False


class Network:
    """A shared medium, for both clocks.

    Args:
        kernel: Clock that it takes time of.
        name: Name in messages.
        bandwidth_bit_s: Bits per second, above 0.
        latency: Time between the end of serialisation and arrival, ns.
        loss: Probability that a transmission is lost, 0 to 1.
        stream: Random numbers for the losses.

    Sizes are in bytes on the medium, headers included.

    Raises:
        UsageError: an argument is out of range.
    """

    def __init__(
        self, kernel: Kernel, name: str, *, bandwidth_bit_s: int, latency: Ns, loss: float, stream: Random
    ) -> None:
        if bandwidth_bit_s <= 0 or latency < 0 or not 0.0 <= loss <= 1.0:
            raise UsageError(
                f"{name}: bandwidth {bandwidth_bit_s} bit/s must be above 0, "
                f"latency {latency} ns at least 0, loss {loss} between 0 and 1"
            )
        self._kernel, self.name = kernel, name
        self._bandwidth, self._latency, self._loss, self._stream = bandwidth_bit_s, latency, loss, stream
        self._usual = latency, loss
        self._free: Ns = 0  # when the medium is free
        self._queues: dict[str, deque[Transfer]] = {}

    def degrade(self, *, loss: float = 0.0, delay: Ns = 0) -> None:
        """Set at least this `loss` and `delay` ns more latency than stated at the start; 0 restores it."""
        usual_latency, usual_loss = self._usual
        self._latency, self._loss = usual_latency + delay, max(usual_loss, loss)

    def serialisation(self, size: int) -> Ns:
        """Return the time that `size` bytes occupy the medium, ns."""
        return -(-size * 8 * S // self._bandwidth)

    def _transmit(self, size: int) -> tuple[Ns, Ns, bool]:
        """Occupy the medium in turn; return when sending starts, when it arrives, and whether it is lost."""
        start = max(self._free, self._kernel.now())
        self._free = start + self.serialisation(size)
        return start, self._free + self._latency, self._stream.random() < self._loss

    def send(self, size: int, deliver: Action, lost: Action | None = None) -> None:
        """Send best-effort: call `deliver` at the arrival, or `lost` at that time. Never blocks."""
        sent = self._kernel.now()
        _, arrival, is_lost = self._transmit(size)
        if not is_lost:
            self._kernel.call_at(arrival, partial(self._deliver, sent, size, deliver))
            return
        self._kernel.record(Transmission(sent, NONE, self.serialisation(size), self.name, size))
        if lost is not None:
            self._kernel.call_at(arrival, lost)

    def _deliver(self, sent: Ns, size: int, deliver: Action) -> None:
        kernel = self._kernel
        kernel.record(Transmission(sent, kernel.now(), self.serialisation(size), self.name, size))
        deliver()

    def send_reliable(self, size: int, deliver: Action, stream: str = "") -> None:
        """Send until it arrives, then call `deliver`. Transfers of one `stream` are delivered in order."""
        queue = self._queues.setdefault(stream, deque()) if stream else deque()
        self._begin(Transfer(self._kernel.now(), size, deliver, queue))

    def carry(self, size: int, deadline: Ns | None = None) -> None:
        """Block the current task until `size` bytes have arrived, repeated as often as necessary.

        Raises:
            LinkLost: they have not arrived by `deadline`, ns.
        """
        kernel = self._kernel
        with kernel.interact():
            task = current_task(kernel)
            start = kernel.now()
            transfer = Transfer(start, size, lambda: kernel.wake(task), deque())
            self._begin(transfer)
            try:
                while not transfer.arrived:
                    if not kernel.park(deadline, self.name) and not transfer.arrived:
                        waited = to_seconds(kernel.now() - start)
                        raise LinkLost(f"{self.name}: {size} bytes did not get through within {waited:g} s")
            finally:
                if not transfer.arrived and transfer.next is not None:
                    transfer.next.cancel()
                    kernel.record(Transmission(start, NONE, transfer.occupied, self.name, size))

    def _begin(self, transfer: Transfer) -> None:
        transfer.queue.append(transfer)
        self._try(transfer)

    def _try(self, transfer: Transfer) -> None:
        start, arrival, is_lost = self._transmit(transfer.size)
        transfer.occupied += self.serialisation(transfer.size)
        if is_lost:
            again = start + 2 * self._latency + self.serialisation(transfer.size)
            transfer.next = self._kernel.call_at(again, partial(self._try, transfer))
        else:
            transfer.next = self._kernel.call_at(arrival, partial(self._arrive, transfer))

    def _arrive(self, transfer: Transfer) -> None:
        transfer.arrived = True
        queue = transfer.queue
        while queue and queue[0].arrived:
            first, now = queue.popleft(), self._kernel.now()
            self._kernel.record(Transmission(first.begun, now, first.occupied, self.name, first.size))
            first.deliver()
