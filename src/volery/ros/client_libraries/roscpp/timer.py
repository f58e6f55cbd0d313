"""A ``ros::Timer``: calls back while the node spins."""

from __future__ import annotations

from volery.base.errors import UsageError
from volery.base.time import Ns
from volery.ros.client_libraries.roscpp.session import Session
from volery.ros.client_libraries.wire import Writer
from volery.ros.graph import Timer


class CppTimer:
    """Calls the callable numbered *callback* each *period*, or once."""

    def __init__(self, session: Session, period: Ns, callback: int, *, oneshot: bool) -> None:
        if period <= 0:
            raise UsageError(
                f"{session.component}: a ros::Timer with a period of {period} ns; it must be above 0"
            )
        self._session = session
        self._period = period
        self._callback = callback
        self._oneshot = oneshot
        self._timer: Timer | None = None
        self._expected: Ns = 0
        self._last: tuple[Ns, Ns] = (0, 0)  # when the last call was expected, and when it was
        self._took: Ns = 0

    @property
    def started(self) -> bool:
        """Whether it will call back."""
        return self._timer is not None

    def start(self) -> None:
        """Call back, for the first time after one period. Nothing changes if it does already."""
        if self._timer is None:
            self._expected = self._session.now() + self._period
            self._timer = self._session.node.timer(self._period, self._fire)

    def close(self) -> None:
        """Call back no longer."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def change(self, period: Ns) -> None:
        """Another period, counted from now."""
        self._period = period
        if self.started:
            self.close()
            self.start()

    def _fire(self) -> None:
        now, expected = self._session.now(), self._expected
        event = Writer()
        for moment in (*self._last, expected, now, self._took):
            event.integer(moment)
        self._last = expected, now
        self._expected += self._period * max(1, (now - expected) // self._period + 1)
        if self._oneshot:
            self.close()
        self._session.call_back(self._callback, event.done())
        self._took = self._session.now() - now
