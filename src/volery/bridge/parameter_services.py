"""Services that read and set the autopilot's parameters, and ``param/param_value``, which says each that
is heard.

``param/pull`` reads all of them and sets them as ROS parameters below ``param`` in the node's namespace;
``param/push`` sends those that were changed there since. Where the graph takes no such parameters,
``param/pull`` still publishes them.
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

ANSWER_WITHIN: Ns = 1000 * MS
TRIES = 3
REAL32, REAL64 = 9, 10
PARAMETERS = "param"
"""Where ROS parameters are."""
VALUE = "mavros_msgs/msg/Param"

PARAMETER_TOPICS = (Topic("param/param_value", VALUE, on_demand=True),)


class ParameterServices:
    """Handlers and a translator. An unknown parameter is not answered by ArduPilot.

    ``success`` is false after three seconds.
    """

    def __init__(self, around: InterfaceContext) -> None:
        self._around = around
        self._wire = around.wire
        self._types: dict[str, int] = {}
        self._values: dict[str, float] = {}
        self._complete = False

    def services(self) -> Mapping[str, Service]:
        """Handlers by the service's name, with its type."""
        return {
            "param/get": ("mavros_msgs/srv/ParamGet", self.get),
            "param/set": ("mavros_msgs/srv/ParamSet", self.put),
            "param/pull": ("mavros_msgs/srv/ParamPull", self.pull),
            "param/push": ("mavros_msgs/srv/ParamPush", self.push),
        }

    def translators(self) -> Mapping[str, Translator]:
        """By the name of the frame."""
        return {"PARAM_VALUE": self._heard}

    # -- values, as this firmware writes them

    @property
    def _bytewise(self) -> bool:
        return self._wire.firmware.autopilot == PX4_ID

    def _value(self, said: Fields) -> float:
        value: float = said["param_value"]
        return from_bytewise(said["param_type"], value) if self._bytewise else value

    def _written(self, kind: int, value: float) -> Fields:
        return {"param_value": to_bytewise(kind, value) if self._bytewise else value, "param_type": kind}

    def _message(self, said: Fields) -> Any:
        value = self._value(said)
        given = {"real": value} if said["param_type"] in (REAL32, REAL64) else {"integer": round(value)}
        return new("mavros_msgs/msg/ParamValue", **given)

    def _note(self, said: Fields) -> None:
        name = said["param_id"]
        self._types[name], self._values[name] = said["param_type"], self._value(said)

    def _heard(self, said: Fields, at: Ns) -> None:
        self._note(said)
        if self._around.wanted("param/param_value"):
            message = new(VALUE, header=stamped(at), param_id=said["param_id"], value=self._message(said))
            message.param_index, message.param_count = said["param_index"], said["param_count"]
            self._around.publish("param/param_value", message)

    # -- one

    def _ask(self, name: str, message: str, fields: Fields) -> Frame | None:
        with self._wire.listen("PARAM_VALUE") as ear:
            for _ in range(TRIES):
                self._wire.send_to(message, {"param_id": name, **fields})
                answer = ear.next(ANSWER_WITHIN)
                while answer is not None and answer.fields["param_id"] != name:
                    answer = ear.next(ANSWER_WITHIN)
                if answer is not None:
                    return answer
        return None

    def _set(self, name: str, kind: int, value: float) -> Frame | None:
        return self._ask(name, "PARAM_SET", self._written(kind, value))

    def _response(self, service_type: str, answer: Frame | None) -> Any:
        response = service(service_type).response
        return response() if answer is None else response(True, self._message(answer.fields))

    def get(self, request: Any) -> Any:
        """``param/get``."""
        answer = self._ask(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        return self._response("mavros_msgs/srv/ParamGet", answer)

    def put(self, request: Any) -> Any:
        """``param/set``: an integer that is not 0 counts, else the real."""
        known = self._ask(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        if known is not None:
            value = float(request.value.integer or request.value.real)
            known = self._set(request.param_id, known.fields["param_type"], value)
        return self._response("mavros_msgs/srv/ParamSet", known)

    # -- all

    def pull(self, request: Any) -> Any:
        """``param/pull``: read all, unless they are known and *force_pull* does not ask for it."""
        wanted = request.force_pull or not self._complete
        self._complete = not wanted or self._read_all()
        try:
            self._around.node.set_parameter(PARAMETERS, {name: self._of_ros(name) for name in self._values})
        except VoleryError as error:
            self._around.warn(f"param/pull: not set as ROS parameters: {error}")
        return service("mavros_msgs/srv/ParamPull").response(self._complete, len(self._values))

    def _of_ros(self, name: str) -> float | int:
        value = self._values[name]
        return value if self._types[name] in (REAL32, REAL64) else round(value)

    def _read_all(self) -> bool:
        """Ask for the list, then for each that was lost on the way, until there is silence."""
        found: set[int] = set()
        count = 0
        with self._wire.listen("PARAM_VALUE") as ear:
            for _ in range(TRIES):
                self._wire.send_to("PARAM_REQUEST_LIST", {})
                while (answer := ear.next(ANSWER_WITHIN)) is not None:
                    count = self._keep(answer.fields, found)
                    if len(found) == count:
                        return True
                if found:
                    break
            for _ in range(TRIES):
                while (index := _first_missing(found, count)) is not None:
                    self._wire.send_to("PARAM_REQUEST_READ", {"param_id": "", "param_index": index})
                    answer = ear.next(ANSWER_WITHIN)
                    if answer is None or answer.fields["param_index"] != index:
                        break
                    self._keep(answer.fields, found)
        return bool(found) and len(found) == count

    def _keep(self, said: Fields, found: set[int]) -> int:
        """Note a value; how many there are."""
        count: int = said["param_count"]
        if said["param_index"] < count:
            found.add(said["param_index"])
        self._note(said)
        return count

    def push(self, request: Any) -> Any:
        """``param/push``: send what the ROS parameters say otherwise."""
        response = service("mavros_msgs/srv/ParamPush").response
        stated = self._around.node.get_parameter(PARAMETERS, {})
        sent = 0
        for name, value in sorted(stated.items()):
            if name in self._values and float(value) != self._values[name]:
                if self._set(name, self._types[name], float(value)) is None:
                    return response(False, sent)
                sent += 1
        return response(True, sent)


def _first_missing(found: set[int], count: int) -> int | None:
    return next((index for index in range(count) if index not in found), None)
