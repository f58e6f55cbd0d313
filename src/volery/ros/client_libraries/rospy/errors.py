"""rospy's exceptions, under its own names."""

from __future__ import annotations


class ROSException(Exception):  # noqa: N818 - rospy's name
    """What rospy raises for time-outs and misuse."""


class ROSInitException(ROSException):
    """A call before ``init_node``."""


class ROSSerializationException(ROSException):
    """A value that does not fit its message's field."""


class ROSInterruptException(ROSException, KeyboardInterrupt):
    """The node is shutting down while it sleeps."""


class ROSTimeMovedBackwardsException(ROSInterruptException):
    """Never raised: time does not move backwards here."""


class ServiceException(Exception):  # noqa: N818 - rospy's name
    """A service call did not succeed."""


EXCEPTIONS = {
    kind.__name__: kind
    for kind in (
        ROSException,
        ROSInitException,
        ROSSerializationException,
        ROSInterruptException,
        ROSTimeMovedBackwardsException,
        ServiceException,
    )
}
