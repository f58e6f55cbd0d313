"""Services that read and set the autopilot's parameters."""

from __future__ import annotations

from typing import Any

from volery.base.time import MS, Ns
from volery.bridge.wire import Wire
from volery.graph import Handler
from volery.links.link import Frame
from volery.messages import new, service

ANSWER_WITHIN: Ns = 1000 * MS
TRIES = 3
REAL32, REAL64 = 9, 10


class Parameters:
    """The handlers. An unknown parameter is not answered by ArduPilot.

    ``success`` is false after three seconds.
    """

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def services(self) -> dict[str, tuple[str, Handler]]:
        """Handlers by the service's name, with its type."""
        return {
            "param/get": ("mavros_msgs/srv/ParamGet", self.get),
            "param/set": ("mavros_msgs/srv/ParamSet", self.set),
        }

    def _ask(self, name: str, message: str, fields: dict[str, Any]) -> Frame | None:
        with self._wire.listen("PARAM_VALUE") as ear:
            for _ in range(TRIES):
                self._wire.send_to(message, {"param_id": name, **fields})
                answer = ear.next(ANSWER_WITHIN)
                while answer is not None and answer.fields["param_id"] != name:
                    answer = ear.next(ANSWER_WITHIN)
                if answer is not None:
                    return answer
        return None

    def get(self, request: Any) -> Any:
        """``param/get``."""
        answer = self._ask(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        return _response("mavros_msgs/srv/ParamGet", answer)

    def set(self, request: Any) -> Any:
        """``param/set``: an integer that is not 0 counts, else the real."""
        known = self._ask(request.param_id, "PARAM_REQUEST_READ", {"param_index": -1})
        if known is None:
            return _response("mavros_msgs/srv/ParamSet", None)
        value = float(request.value.integer or request.value.real)
        fields = {"param_value": value, "param_type": known.fields["param_type"]}
        return _response("mavros_msgs/srv/ParamSet", self._ask(request.param_id, "PARAM_SET", fields))


def _response(service_type: str, answer: Frame | None) -> Any:
    response = service(service_type).response
    if answer is None:
        return response()
    value = answer.fields["param_value"]
    real = answer.fields["param_type"] in (REAL32, REAL64)
    given = {"real": value} if real else {"integer": round(value)}
    return response(True, new("mavros_msgs/msg/ParamValue", **given))
