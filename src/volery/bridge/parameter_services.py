"""MAVROS's parameter services, and ``param/param_value``, which publishes each received parameter.

``param/pull`` reads all parameters and sets them as ROS parameters below ``param`` in the node's namespace;
``param/push`` sends those that were changed there. Where the graph does not accept such ROS parameters,
``param/pull`` still publishes the values.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from volery.base.errors import VoleryError
from volery.base.time import MS, Ns
from volery.bridge.mode_names import PX4_ID
from volery.bridge.node_interface import Fields, InterfaceContext, Service, Topic, Translator, stamped
from volery.links.link import Frame
from volery.links.mavlink_conventions import from_bytewise, to_bytewise
from volery.ros.messages import new, service

ANSWER_TIMEOUT: Ns = 1000 * MS
ATTEMPTS = 3
REAL32, REAL64 = 9, 10
PARAMETERS = "param"
"""Name below which the ROS parameters are set."""
VALUE = "mavros_msgs/msg/Param"

PARAMETER_TOPICS = (Topic("param/param_value", VALUE, on_demand=True),)


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
        return {
            "param/get": ("mavros_msgs/srv/ParamGet", self.get),
            "param/set": ("mavros_msgs/srv/ParamSet", self.put),
            "param/pull": ("mavros_msgs/srv/ParamPull", self.pull),
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
            for _ in range(ATTEMPTS):
                self._link.send_to_autopilot(message, {"param_id": name, **fields})
                answer = answers.next(ANSWER_TIMEOUT)
                while answer is not None and answer.fields["param_id"] != name:
                    answer = answers.next(ANSWER_TIMEOUT)
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

    # -- all parameters

    def pull(self, request: Any) -> Any:
        """Handle ``param/pull``: read all parameters, unless they are known and *force_pull* is false."""
        wanted = request.force_pull or not self._complete
        self._complete = not wanted or self._read_all()
        try:
            self._context.node.set_parameter(PARAMETERS, {name: self._as_ros(name) for name in self._values})
        except VoleryError as error:
            self._context.warn(f"param/pull: not set as ROS parameters: {error}")
        return service("mavros_msgs/srv/ParamPull").response(self._complete, len(self._values))

    def _as_ros(self, name: str) -> float | int:
        value = self._values[name]
        return value if self._types[name] in (REAL32, REAL64) else round(value)

    def _read_all(self) -> bool:
        """Request the list, then each parameter that was lost, and return whether all were received."""
        found: set[int] = set()
        count = 0
        with self._link.subscribe("PARAM_VALUE") as answers:
            for _ in range(ATTEMPTS):
                self._link.send_to_autopilot("PARAM_REQUEST_LIST", {})
                while (answer := answers.next(ANSWER_TIMEOUT)) is not None:
                    count = self._keep(answer.fields, found)
                    if len(found) == count:
                        return True
                if found:
                    break
            for _ in range(ATTEMPTS):
                while (index := _first_missing(found, count)) is not None:
                    self._link.send_to_autopilot("PARAM_REQUEST_READ", {"param_id": "", "param_index": index})
                    answer = answers.next(ANSWER_TIMEOUT)
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
