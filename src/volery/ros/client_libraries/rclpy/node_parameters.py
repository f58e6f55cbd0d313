"""What an rclpy node does with its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from volery.ros.client_libraries.rclpy.parameters import Declared, Parameter, Watcher
from volery.ros.messages import new


class NodeParameters:
    """The part of ``Node`` that is about parameters."""

    _declared: Declared

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        """Declare a parameter with its default; what a launch file gives comes first."""
        return self._declared.declare(name, value, descriptor, ignore_override)

    def declare_parameters(
        self, namespace: str, parameters: Sequence[tuple[Any, ...]], ignore_override: bool = False
    ) -> list[Parameter]:
        """Several: ``(name,)``, ``(name, value)`` or ``(name, value, descriptor)``."""
        prefix = f"{namespace}." if namespace else ""
        declared = []
        for name, *rest in parameters:
            value, descriptor = (*rest, None, None)[:2]
            declared.append(self._declared.declare(prefix + name, value, descriptor, ignore_override))
        return declared

    def undeclare_parameter(self, name: str) -> None:
        """Forget it."""
        self._declared.forget(name)

    def has_parameter(self, name: str) -> bool:
        """Whether it is declared."""
        return self._declared.has(name)

    def get_parameter(self, name: str) -> Parameter:
        """Its value now."""
        return self._declared.get(name)

    def get_parameters(self, names: Sequence[str]) -> list[Parameter]:
        """Several."""
        return [self._declared.get(name) for name in names]

    def get_parameter_or(self, name: str, alternative_value: Parameter | None = None) -> Parameter:
        """Its value now, or the alternative."""
        known = self._declared.has(name)
        return self._declared.get(name) if known else alternative_value or Parameter(name)

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Parameter]:
        """Those below *prefix*, without it."""
        start = f"{prefix}." if prefix else ""
        names = [name for name in self._declared.names() if name.startswith(start)]
        return {name.removeprefix(start): self._declared.get(name) for name in names}

    def set_parameters(self, parameter_list: Sequence[Parameter]) -> list[Any]:
        """Each for itself."""
        return [self._declared.set([one]) for one in parameter_list]

    def set_parameters_atomically(self, parameter_list: Sequence[Parameter]) -> Any:
        """All or none."""
        return self._declared.set(parameter_list)

    def describe_parameter(self, name: str) -> Any:
        """Its descriptor."""
        return self._declared.descriptor(name)

    def add_on_set_parameters_callback(self, callback: Watcher) -> Watcher:
        """Ask it before values are set."""
        self._declared.watch(callback)
        return callback

    def remove_on_set_parameters_callback(self, callback: Watcher) -> None:
        """Ask it no longer."""
        self._declared.unwatch(callback)

    def get_parameter_type(self, name: str) -> Parameter.Type:
        """The type of its value now."""
        return self._declared.get(name).type_

    def get_parameter_types(self, names: Sequence[str]) -> list[Parameter.Type]:
        """Several."""
        return [self.get_parameter_type(name) for name in names]

    def describe_parameters(self, names: Sequence[str]) -> list[Any]:
        """Several descriptors."""
        return [self._declared.descriptor(name) for name in names]

    def list_parameters(self, prefixes: Sequence[str], depth: int) -> Any:
        """A ``ListParametersResult``: names at most *depth* levels below a prefix (0: all levels)."""
        result = new("rcl_interfaces/msg/ListParametersResult")
        for name in self._declared.names():
            if any(_is_below(name, prefix, depth) for prefix in prefixes or ("",)):
                result.names.append(name)
                above = name.rpartition(".")[0]
                if above and above not in result.prefixes:
                    result.prefixes.append(above)
        return result


def _is_below(name: str, prefix: str, depth: int) -> bool:
    if name == prefix:
        return True
    start = f"{prefix}." if prefix else ""
    return name.startswith(start) and (not depth or name.removeprefix(start).count(".") < depth)
