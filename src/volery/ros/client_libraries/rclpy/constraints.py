"""What a parameter's descriptor allows, refused in rclpy's words."""

from __future__ import annotations

from math import isclose
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.ros.client_libraries.rclpy.parameters import Parameter

_NAMES = (
    "NOT_SET", "BOOL", "INTEGER", "DOUBLE", "STRING",
    "BYTE_ARRAY", "BOOL_ARRAY", "INTEGER_ARRAY", "DOUBLE_ARRAY", "STRING_ARRAY",
)  # fmt: skip
_NEAR = 1e-6
"""How near a double must be to a bound or a step to count as on it, relatively."""


def unfit(one: Parameter, descriptor: Any, *, declared: bool) -> str:
    """Why *one* may not be set; empty if it may. *declared*: it has been there before."""
    if declared and descriptor.read_only:
        return f"Trying to set a read-only parameter: {one.name}."
    if not descriptor.dynamic_typing:
        if declared and not one.type_:
            return "Static parameter cannot be undeclared"
        if one.type_ and descriptor.type and one.type_ != descriptor.type:
            expected, given = _NAMES[descriptor.type], _NAMES[one.type_]
            return f"Wrong parameter type, expected 'Type.{expected}' got 'Type.{given}'"
    whole = isinstance(one.value, int) and not isinstance(one.value, bool)
    if whole and len(descriptor.integer_range):
        return _beyond_integers(one, descriptor.integer_range[0])
    if isinstance(one.value, float) and len(descriptor.floating_point_range):
        return _beyond_doubles(one, descriptor.floating_point_range[0])
    return ""


def _bounds(limits: Any) -> tuple[Any, Any]:
    return min(limits.from_value, limits.to_value), max(limits.from_value, limits.to_value)


def _beyond_integers(one: Parameter, limits: Any) -> str:
    least, most = _bounds(limits)
    if one.value in (least, most):
        return ""
    if not least < one.value < most:
        return f"Parameter {one.name} out of range. Min: {least}, Max: {most}, value: {one.value}"
    if limits.step and (one.value - least) % limits.step:
        return (
            f"The parameter value for {one.name} is not a valid step. "
            f"Min: {least}, max: {most}, value: {one.value}, step: {limits.step}"
        )
    return ""


def _beyond_doubles(one: Parameter, limits: Any) -> str:
    least, most = _bounds(limits)
    if any(isclose(one.value, bound, rel_tol=_NEAR) for bound in (least, most)):
        return ""
    if not least < one.value < most:
        return f"Parameter {one.name} out of range Min: {least}, Max: {most}, value: {one.value}"
    if limits.step:
        nearest = least + round((one.value - least) / limits.step) * limits.step
        if not isclose(nearest, one.value, rel_tol=_NEAR):
            return (
                f"The parameter value for {one.name} is not close enough to a valid step. "
                f"Min: {least}, max: {most}, value: {one.value}, step: {limits.step}"
            )
    return ""
