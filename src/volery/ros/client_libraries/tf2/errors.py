"""tf2's exceptions, under its own names."""

from __future__ import annotations


class TransformException(Exception):  # noqa: N818 - tf2's name
    """What tf2 raises."""


class LookupException(TransformException):
    """A frame that nobody has told of."""


class ConnectivityException(TransformException):
    """Two frames that nothing connects."""


class ExtrapolationException(TransformException):
    """A time that is before or after all that is known."""


class InvalidArgumentException(TransformException):
    """A frame's name, or a rotation, that is none."""


class TimeoutException(TransformException):
    """It took too long."""


EXCEPTIONS = {
    kind.__name__: kind
    for kind in (
        TransformException,
        LookupException,
        ConnectivityException,
        ExtrapolationException,
        InvalidArgumentException,
        TimeoutException,
    )
}
