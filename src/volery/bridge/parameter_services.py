"""MAVROS's parameter services over MAVLink's parameter protocol.

``param/pull`` reads all parameters. As MAVROS 1 it then sets them as ROS parameters below ``param`` in the
node's namespace, and ``param/push`` sends those that were changed there. As MAVROS 2 the node offers the
parameter services of ROS 2 under ``param/`` instead. ``param/param_value`` publishes each received parameter.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isclose
from typing import Any

from volery.base.errors import VoleryError
from volery.base.time import MS, Ns
from volery.bridge.autopilot_link import PX4_ID
from volery.bridge.node_interface import (
    Fields,
    InterfaceContext,
    PublishedByNode,
    Service,
    Translator,
    stamped,
)
from volery.links.frame import Frame
from volery.links.mavlink_messages import from_bytewise, to_bytewise
from volery.ros.messages import new, service

PARAMETER_TIMEOUT: Ns = 1000 * MS
PARAMETER_ATTEMPTS = 3
REAL32, REAL64 = 9, 10
PARAMETERS = "param"
"""Name below which the ROS parameters are set."""
VALUE = "mavros_msgs/msg/Param"
ROS_INTEGER, ROS_DOUBLE = 2, 3
"""rcl_interfaces/ParameterType."""

PARAMETER_TOPICS = (PublishedByNode("param/param_value", VALUE, on_demand=True),)


class ParameterServices:
    """Handlers of the parameter services and the translator of PARAM_VALUE.

    ArduPilot does not answer a request for an unknown parameter: ``success`` is false after three seconds.
    """

    def __init__(self, context: InterfaceContext) -> None:
        self._context = context
        self._link = context.link
        self._types: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self._complete = False

    def services(self) -> Mapping[str, Service]:
        """Return types and handlers by service name."""
        pull = {"param/pull": ("mavros_msgs/srv/ParamPull", self.pull)}
        if self._context.parameter_services:
            return {
                **pull,
                "param/set": ("mavros_msgs/srv/ParamSetV2", self.put_ros2),
                "param/list_parameters": ("rcl_interfaces/srv/ListParameters", self.list_ros2),
                "param/get_parameters": ("rcl_interfaces/srv/GetParameters", self.get_ros2),
                "param/set_parameters": ("rcl_interfaces/srv/SetParameters", self.set_ros2),
            }
        return {
            **pull,
            "param/get": ("mavros_msgs/srv/ParamGet", self.get),
            "param/set": ("mavros_msgs/srv/ParamSet", self.put),
            "param/push": ("mavros_msgs/srv/ParamPush", self.push),
        }

    def translators(self) -> Mapping[str, Translator]:
        """Return the translators by message name."""
        return {"PARAM_VALUE": self._publish_value}

    # -- values in the encoding of the firmware

    @property
    def _bytewise(self) -> bool:
        return self._link.autopilot.autopilot == PX4_ID

    def _value(self, fields: Fields) -> float:
        value: float = fields["param_value"]
        return from_bytewise(fields["param_type"], value) if self._bytewise else value

    def _encoded(self, kind: int, value: float) -> Fields:
        return {"param_value": to_bytewise(kind, value) if self._bytewise else value, "param_type": kind}

    def _message(self, fields: Fields) -> Any:
        value = self._value(fields)
        given = {"real": value} if fields["param_type"] in (REAL32, REAL64) else {"integer": round(value)}
        return new("mavros_msgs/msg/ParamValue", **given)

    def _store(self, fields: Fields) -> None:
        name = fields["param_id"]
        self._types[name], self._values[name] = fields["param_type"], self._value(fields)

    def _publish_value(self, fields: Fields, at: Ns) -> None:
        self._store(fields)
        if self._context.wanted("param/param_value"):
            message = new(VALUE, header=stamped(at), param_id=fields["param_id"], value=self._message(fields))
            message.param_index, message.param_count = fields["param_index"], fields["param_count"]
            self._context.publish("param/param_value", message)

    # -- single parameters

    def _request(self, name: str, message: str, fields: Fields) -> Frame | None:
        with self._link.subscribe("PARAM_VALUE") as answers:
            for _ in range(PARAMETER_ATTEMPTS):
                self._link.send_to_autopilot(message, {"param_id": name, **fields})
                answer = answers.next(PARAMETER_TIMEOUT)
                while answer is not None and answer.fields["param_id"] != name:
                    answer = answers.next(PARAMETER_TIMEOUT)
                if answer is not None:
                    return answer
        return None

    def _set(self, name: str, kind: int, value: float) -> Frame | None:
        return self._request(name, "PARAM_SET", self._encoded(kind, value))

    def _response(self, service_type: str, answer: Frame | None) -> Any:
        response = service(service_type).response
        return response() if answer is None else response(True, self._message(answer.fields))

    def get(self, request: Any) -> Any:
        """Handle ``param/get``."""
        answer = self._request(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        return self._response("mavros_msgs/srv/ParamGet", answer)

    def put(self, request: Any) -> Any:
        """Handle ``param/set``: the integer is used unless it is 0, else the real."""
        known = self._request(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        if known is not None:
            value = float(request.value.integer or request.value.real)
            known = self._set(request.param_id, known.fields["param_type"], value)
        return self._response("mavros_msgs/srv/ParamSet", known)

    # -- single parameters, by the services of ROS 2

    def _ros2_value(self, name: str) -> Any:
        """Return a known value as ParameterValue, one that is not known as NOT_SET."""
        if not self._known(name):
            return new("rcl_interfaces/msg/ParameterValue")
        value = self._as_ros(name)
        given = (
            {"type": ROS_INTEGER, "integer_value": value}
            if isinstance(value, int)
            else {"type": ROS_DOUBLE, "double_value": value}
        )
        return new("rcl_interfaces/msg/ParameterValue", **given)

    def _known(self, name: str) -> bool:
        """Return whether the autopilot has the parameter, which is read if it is not known yet."""
        if name not in self._values and not self._complete:
            self._keep_if_answered(self._request(name, "PARAM_REQUEST_READ", {"param_index": -1}))
        return name in self._values

    def _keep_if_answered(self, answer: Frame | None) -> bool:
        if answer is not None:
            self._store(answer.fields)
        return answer is not None

    def _write_ros2(self, name: str, value: Any) -> str:
        """Set a parameter to a ParameterValue; return why it was not set, or an empty text."""
        if value.type not in (ROS_INTEGER, ROS_DOUBLE):
            return "an autopilot's parameter is an integer or a double"
        if not self._known(name):
            return "the autopilot does not answer for such a parameter"
        number = float(value.integer_value if value.type == ROS_INTEGER else value.double_value)
        if not self._keep_if_answered(self._set(name, self._types[name], number)):
            return "the autopilot does not answer"
        kept = self._values[name]
        return "" if isclose(kept, number, rel_tol=1e-6) else f"the autopilot keeps {kept:g}"

    def put_ros2(self, request: Any) -> Any:
        """Handle ``param/set`` of MAVROS 2."""
        problem = self._write_ros2(request.param_id, request.value)
        return service("mavros_msgs/srv/ParamSetV2").response(not problem, self._ros2_value(request.param_id))

    def list_ros2(self, request: Any) -> Any:
        """Handle ``list_parameters``: those below the prefixes, which are names here."""
        names = [name for name in self._values if not request.prefixes or name in request.prefixes]
        result = new("rcl_interfaces/msg/ListParametersResult", names=names)
        return service("rcl_interfaces/srv/ListParameters").response(result)

    def get_ros2(self, request: Any) -> Any:
        """Handle ``get_parameters``."""
        values = [self._ros2_value(name) for name in request.names]
        return service("rcl_interfaces/srv/GetParameters").response(values)

    def set_ros2(self, request: Any) -> Any:
        """Handle ``set_parameters``: each on its own."""
        problems = [self._write_ros2(parameter.name, parameter.value) for parameter in request.parameters]
        kind = "rcl_interfaces/msg/SetParametersResult"
        results = [new(kind, successful=not problem, reason=problem) for problem in problems]
        return service("rcl_interfaces/srv/SetParameters").response(results)

    # -- all parameters

    def pull(self, request: Any) -> Any:
        """Handle ``param/pull``: read all parameters, unless they are known and *force_pull* is false."""
        wanted = request.force_pull or not self._complete
        self._complete = not wanted or self._read_all()
        if not self._context.parameter_services:
            self._set_ros_parameters()
        return service("mavros_msgs/srv/ParamPull").response(self._complete, len(self._values))

    def _set_ros_parameters(self) -> None:
        try:
            self._context.node.set_parameter(PARAMETERS, {name: self._as_ros(name) for name in self._values})
        except VoleryError as error:
            self._context.warn(f"param/pull: not set as ROS parameters: {error}")

    def _as_ros(self, name: str) -> float | int:
        value = self._values[name]
        return value if self._types[name] in (REAL32, REAL64) else round(value)

    def _read_all(self) -> bool:
        """Request the list, then each parameter that was lost, and return whether all were received."""
        found: set[int] = set()
        count = 0
        with self._link.subscribe("PARAM_VALUE") as answers:
            for _ in range(PARAMETER_ATTEMPTS):
                self._link.send_to_autopilot("PARAM_REQUEST_LIST", {})
                while (answer := answers.next(PARAMETER_TIMEOUT)) is not None:
                    count = self._keep(answer.fields, found)
                    if len(found) == count:
                        return True
                if found:
                    break
            for _ in range(PARAMETER_ATTEMPTS):
                while (index := _first_missing(found, count)) is not None:
                    self._link.send_to_autopilot("PARAM_REQUEST_READ", {"param_id": "", "param_index": index})
                    answer = answers.next(PARAMETER_TIMEOUT)
                    if answer is None or answer.fields["param_index"] != index:
                        break
                    self._keep(answer.fields, found)
        return bool(found) and len(found) == count

    def _keep(self, fields: Fields, found: set[int]) -> int:
        """Store a value and return the number of parameters."""
        count: int = fields["param_count"]
        if fields["param_index"] < count:
            found.add(fields["param_index"])
        self._store(fields)
        return count

    def push(self, request: Any) -> Any:
        """Handle ``param/push``: send the ROS parameters that differ from the known values."""
        response = service("mavros_msgs/srv/ParamPush").response
        given = self._context.node.get_parameter(PARAMETERS, {})
        sent = 0
        for name, value in sorted(given.items()):
            if name in self._values and float(value) != self._values[name]:
                if self._set(name, self._types[name], float(value)) is None:
                    return response(False, sent)
                sent += 1
        return response(True, sent)


def _first_missing(found: set[int], count: int) -> int | None:
    return next((index for index in range(count) if index not in found), None)
