"""rclpy's exceptions under their original names."""

from __future__ import annotations

from typing import Any


class NotInitializedException(Exception):  # noqa: N818 - rclpy's name
    """A call before ``rclpy.init()`` or after ``rclpy.shutdown()``."""

    def __init__(self, *words: Any) -> None:
        super().__init__(*(words or ("rclpy.init() has not been called",)))


class ShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The executor was shut down."""


class ExternalShutdownException(Exception):  # noqa: N818 - rclpy's name
    """The context was shut down while an executor was spinning."""

    def __init__(self) -> None:
        super().__init__("context was shut down")


class TimeoutException(Exception):  # noqa: N818 - rclpy's name
    """Nothing became ready before the time-out."""


class InvalidHandle(Exception):  # noqa: N818 - rclpy's name
    """A destroyed entity is used."""


class ROSInterruptException(Exception):  # noqa: N818 - rclpy's name
    """The context was shut down while a rate slept."""

    def __init__(self) -> None:
        super().__init__("rclpy has been shut down")


class NameValidationException(Exception):  # noqa: N818 - rclpy's name
    """A name is not a valid ROS name."""


class ParameterException(Exception):  # noqa: N818 - rclpy's name
    """Base class of the errors about parameters."""

    def __init__(self, error_msg: str, parameters: Any) -> None:
        super().__init__(error_msg, parameters)


class ParameterNotDeclaredException(ParameterException):
    """A parameter is not declared."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Invalid access to undeclared parameter(s)", parameters)


class ParameterAlreadyDeclaredException(ParameterException):
    """A parameter is declared twice."""

    def __init__(self, parameters: Any) -> None:
        super().__init__("Parameter(s) already declared", parameters)


class ParameterImmutableException(ParameterException):
    """A parameter is read-only."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("Attempted to modify read-only parameter", parameter)


class ParameterUninitializedException(ParameterException):
    """A parameter was declared without a value and has none."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("The parameter is not initialized", parameter)


class InvalidParameterException(ParameterException):
    """A name of a parameter is invalid."""

    def __init__(self, parameter: Any) -> None:
        super().__init__("Invalid parameter name", parameter)


class InvalidParameterTypeException(ParameterException):
    """A value has another type than was declared."""

    def __init__(self, desired: Any, current: str) -> None:
        super().__init__(
            f"Trying to set parameter '{desired.name}' to '{desired.value}' of type "
            f"'{desired.type_.name}', expecting type '{current}'",
            desired.name,
        )


class InvalidParameterValueException(ParameterException):
    """A value was refused."""

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
"""Content of ``rclpy.exceptions``."""
