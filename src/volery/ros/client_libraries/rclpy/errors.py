"""rclpy's exceptions, under its own names."""

from __future__ import annotations

from typing import Any


class NotInitializedException(Exception):  # noqa: N818 - rclpy's name
    """A call before ``rclpy.init()`` or after ``rclpy.shutdown()``."""

    def __init__(self, *words: Any) -> None:
        super().__init__(*(words or ("rclpy.init() has not been called",)))


class ShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The executor was shut down."""


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The context was shut down while somebody spun."""

    def __init__(self) -> None:
        super().__init__("context was shut down")


class TimeoutException(Exception):  # noqa: N818 - rclpy's name
    """Nothing became ready in time."""


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """What was destroyed is used."""


class ROSInterruptException(Exception):  # noqa: N818 - rclpy's name
    """The context was shut down while it slept."""

    def __init__(self) -> None:
        super().__init__("rclpy has been shut down")


class NameValidationException(Exception):  # noqa: N818 - rclpy's name
    """A name that is no ROS name."""


class ParameterException(Exception):  # noqa: N818 - rclpy's name
    """What parameters raise."""

    def __init__(self, error_msg: str, parameters: Any) -> None:
        super().__init__(error_msg, parameters)


class ParameterNotDeclaredException(ParameterException):
    """A parameter that nobody declared."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Invalid access to undeclared parameter(s)", parameters)


class ParameterAlreadyDeclaredException(ParameterException):
    """Declared twice."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Parameter(s) already declared", parameters)


class ParameterImmutableException(ParameterException):
    """It is read-only."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("Attempted to modify read-only parameter", parameter)


class ParameterUninitializedException(ParameterException):
    """Declared without a value, and none was given."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("The parameter is not initialized", parameter)


class InvalidParameterException(ParameterException):
    """A name that is none."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("Invalid parameter name", parameter)


class InvalidParameterTypeException(ParameterException):
    """A value of another type than was declared."""

    def __init__(self, desired: Any, current: str) -> None:
        super().__init__(
            f"Trying to set parameter '{desired.name}' to '{desired.value}' of type "
            f"'{desired.type_.name}', expecting type '{current}'",
            desired.name,
        )


class InvalidParameterValueException(ParameterException):
    """A callback refused the value."""

    def __init__(self, parameter: Any, value: Any, reason: str) -> None:
        super().__init__(f"Invalid parameter value ({value}) for parameter. {reason}", parameter)


EXCEPTIONS = {
    kind.__name__: kind
    for kind in (
        NotInitializedException,
        NameValidationException,
        InvalidHandle,
        InvalidParameterException,
        InvalidParameterTypeException,
        InvalidParameterValueException,
        ParameterAlreadyDeclaredException,
        ParameterException,
        ParameterImmutableException,
        ParameterNotDeclaredException,
        ParameterUninitializedException,
        ROSInterruptException,
    )
}
"""``rclpy.exceptions``."""
