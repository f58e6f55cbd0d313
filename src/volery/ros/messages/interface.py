"""An interface file's text as the messages that it stands for."""

from __future__ import annotations

from volery.base.errors import UsageError

_ID = "unique_identifier_msgs/UUID goal_id\n"


def parts(name: str, text: str) -> dict[str, str]:
    """The messages behind ``package/msg/Name``, ``package/srv/Name`` or ``package/action/Name``, by name.

    A service has ``Name_Request`` and ``Name_Response``. An action has what ROS 2 makes of it: ``Name_Goal``,
    ``Name_Result``, ``Name_Feedback``, the services ``Name_SendGoal`` and ``Name_GetResult``, and
    ``Name_FeedbackMessage``.
    """
    package, kind, label = [*name.split("/"), "", ""][:3]
    if not package or kind not in ("msg", "srv", "action") or not label or name.count("/") != 2:
        raise UsageError(
            f"{name!r} is no name of a type: package/msg/Name, package/srv/Name or package/action/Name"
        )
    if kind == "msg":
        return {name: text}
    if kind == "srv":
        request, response = _split(name, text, "a request and a response", 2)
        return {f"{name}_Request": request, f"{name}_Response": response}
    goal, result, feedback = _split(name, text, "a goal, a result and a feedback", 3)
    inner = f"{package}/msg/{label}"  # rosbags writes out no definition with an action's parts inside
    return {
        f"{inner}_Goal": goal,
        f"{inner}_Result": result,
        f"{inner}_Feedback": feedback,
        f"{name}_SendGoal_Request": f"{_ID}{package}/{label}_Goal goal",
        f"{name}_SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp",
        f"{name}_GetResult_Request": _ID,
        f"{name}_GetResult_Response": f"int8 status\n{package}/{label}_Result result",
        f"{name}_FeedbackMessage": f"{_ID}{package}/{label}_Feedback feedback",
    }


def _split(name: str, text: str, what: str, count: int) -> list[str]:
    found = f"\n{text}".split("\n---")
    if len(found) != count:
        lines = "one line '---'" if count == 2 else f"{count - 1} lines '---'"
        raise UsageError(f"{name}: {what}, with {lines} between them; here are {len(found)} parts")
    return found
