"""C++ headers of types as ROS 2 has them: ``std_msgs/msg/string.hpp``, ``std_srvs/srv/set_bool.hpp`` etc."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from volery.base.errors import choices
from volery.ros import messages
from volery.ros.client_libraries.cpp.message_structs import (
    BASES,
    SHARED_INCLUDE,
    constant_lines,
    refusal,
    text_literal,
    visit_lines,
    with_ours,
)
from volery.ros.messages.encodings import FieldLayout, MessageLayout, ros2_layout
from volery.ros.messages.store import action_types

INCLUDE = Path(__file__).parent / "include"
_HEADER = re.compile(r"^(\w+)/(msg|srv|action)/(?:detail/)?([a-z0-9_]+?)(?:__[a-z_]+)?\.hpp$")
_ROS1_HEADER = re.compile(r"^(\w+)/([A-Z]\w*)\.h$")
_TYPES = {**BASES, "bool": "bool", "byte": "std::uint8_t", "octet": "std::uint8_t"}

_CONTAINED = {
    "rclcpp/rclcpp.hpp": ("any_executor", "create_publisher", "create_subscription", "visibility_control"),
    "rclcpp/time.hpp": ("clock", "duration", "rate"),
    "rclcpp/context.hpp": (
        *("contexts/default_context", "exceptions", "exceptions/exceptions", "utilities", "macros"),
        "init_options",
    ),
    "rclcpp/logging.hpp": ("logger",),
    "rclcpp/message.hpp": ("message_info", "serialization", "serialized_message", "typesupport_helpers"),
    "rclcpp/parameter.hpp": ("parameter_value", "parameter_map"),
    "rclcpp/publisher.hpp": (
        *("publisher_base", "publisher_options", "generic_publisher", "loaned_message", "event_handler"),
        *("callback_group", "qos_event"),
    ),
    "rclcpp/subscription.hpp": ("subscription_base", "subscription_options", "generic_subscription"),
    "rclcpp/service.hpp": ("client",),
    "rclcpp/node.hpp": (
        *("create_client", "create_service", "create_timer", "event", "node_options", "wait_for_message"),
        *("create_generic_publisher", "create_generic_subscription"),
        *(
            f"node_interfaces/{name}"
            for name in (
                *("node_base_interface", "node_clock_interface", "node_logging_interface", "node_interfaces"),
                *("node_parameters_interface", "node_topics_interface", "node_timers_interface"),
                *("node_services_interface", "node_graph_interface", "node_waitables_interface"),
            )
        ),
    ),
    "rclcpp/executor.hpp": (
        *("executors", "executors/single_threaded_executor", "executors/multi_threaded_executor"),
        *("executors/static_single_threaded_executor", "future_return_code", "executor_options"),
        "experimental/executors/events_executor/events_executor",
    ),
    "rclcpp_action/rclcpp_action.hpp": (
        *("client", "client_goal_handle", "create_client", "create_server", "exceptions", "server"),
        *("server_goal_handle", "types"),
    ),
    "rclcpp/parameter_client.hpp": ("parameter_event_handler",),
    "rclcpp_lifecycle/lifecycle_node.hpp": (
        *(
            "lifecycle_publisher",
            "managed_entity",
            "rclcpp_lifecycle",
            "state",
            "transition",
            "visibility_control",
        ),
        *("node_interfaces/lifecycle_node_interface", "type_traits/is_manageable_node"),
    ),
    "tf2_ros/tf2_ros.hpp": (
        *("buffer", "buffer_interface", "create_timer_interface", "create_timer_ros", "transform_listener"),
        *("static_transform_broadcaster", "transform_broadcaster"),
    ),
}
"""Headers that have the content of others here, of which the names are given without folder and ending."""
_OTHER_NAMES = {
    **{
        f"{whole.partition('/')[0]}/{name}.{ending}": whole
        for whole, names in _CONTAINED.items()
        for name in names
        for ending in ("h", "hpp")
    },
    **{
        f"{name}.{ending}": "tf2_ros/geometry.hpp"
        for name in ("tf2_geometry_msgs/tf2_geometry_msgs", "tf2/convert", "tf2/utils", "tf2/time")
        for ending in ("h", "hpp")
    },
    **{f"tf2/transform_datatypes.{ending}": "tf2_ros/geometry.hpp" for ending in ("h", "hpp")},
    **{
        f"message_filters/{name}.hpp": f"message_filters/{name}.h"
        for name in (
            *("cache", "connection", "message_event", "pass_through", "simple_filter", "subscriber"),
            *("synchronizer", "time_synchronizer"),
            *("sync_policies/approximate_time", "sync_policies/exact_time"),
        )
    },
    "diagnostic_updater/diagnostic_updater.h": "diagnostic_updater/diagnostic_updater.hpp",
    "message_filters/message_event.h": "message_filters/library.h",
    "tf2_ros/message_filter.hpp": "tf2_ros/message_filter.h",
    "tf2_sensor_msgs/tf2_sensor_msgs.h": "tf2_sensor_msgs/tf2_sensor_msgs.hpp",
    "tf2/buffer_core.h": "tf2_ros/tf2_ros.hpp",
    "tf2/exceptions.hpp": "tf2/exceptions.h",
    **{
        f"tf2/LinearMath/{name}.hpp": "tf2/linear_math.h"
        for name in ("Matrix3x3", "Quaternion", "Scalar", "Transform", "Vector3")
    },
    "rmw/qos_profiles.h": "rclcpp/qos.hpp",
    "rmw/types.h": "rclcpp/qos.hpp",
    "rcl/time.h": "rclcpp/time.hpp",
    "rcutils/logging.h": "rclcpp/logging.hpp",
}
"""The header that has the content of another one."""


def generate_headers(includes: Sequence[str], path: Path, present: Collection[str] = ()) -> Mapping[str, str]:
    """Return the texts of the headers that *includes* name, and of those they include, by name.

    A header of ROS that is not offered has a comment that says so, so that the compiler does not find a real
    one, and code that includes it in vain compiles. Other names are left to the compiler.

    Args:
        includes: Names in the ``#include`` lines of a file.
        path: File or folder of the component; interface packages near it are found.
        present: Those that are files of the workspace.

    Raises:
        ModelError: The file of an interface is not a valid definition.
    """
    texts = {
        name: f'#pragma once\n#include "{_OTHER_NAMES[name]}"\n' for name in includes if name in _OTHER_NAMES
    }
    includes = with_ours([*includes, *(_OTHER_NAMES[name] for name in texts)], INCLUDE)
    named = [found for name in includes if name not in present and (found := _HEADER.match(name))]
    messages.define_packages(path, dict.fromkeys(found[1] for found in named))
    generator = _Generator()
    for found in named:
        if generator.add(found[1], found[2], found[3]) and found[0] != _file(found[1], found[2], found[3]):
            texts[found[0]] = f'#pragma once\n#include "{_file(found[1], found[2], found[3])}"\n'
    texts.update(generator.texts)
    for name in includes:
        if name in texts or name in present or (INCLUDE / name).exists() or (SHARED_INCLUDE / name).exists():
            continue
        remedy = _remedy(name, generator)
        if remedy:
            texts[name] = refusal(name, remedy)
    return texts


def _remedy(name: str, generator: _Generator) -> str:
    """Return what to do instead of including a header that is not offered; empty where nothing is known."""
    package, _, rest = name.partition("/")
    match = _HEADER.match(name)
    if match and package in generator.packages:
        return f"{package} has {choices(generator.names(package, match[2])) or 'nothing'} in {match[2]}"
    ros1 = _ROS1_HEADER.match(name)
    if ros1 and package in generator.packages:
        return f"it is a header of ROS 1; include <{package}/msg/{_snake(ros1[2])}.hpp>"
    return _NOT_OFFERED.get(package, "") if rest else ""


_NOT_OFFERED = {
    "rclcpp": "include <rclcpp/rclcpp.hpp>, whose content docs/cpp-components.md lists",
    "rclcpp_action": "include <rclcpp_action/rclcpp_action.hpp>",
    "rclcpp_components": "include <rclcpp_components/register_node_macro.hpp>; a node is loaded by the model",
    "rclcpp_lifecycle": "include <rclcpp_lifecycle/lifecycle_node.hpp>",
    "tf2_ros": "include <tf2_ros/transform_listener.h>, <tf2_ros/transform_broadcaster.h>, "
    "<tf2_ros/static_transform_broadcaster.h> or <tf2_ros/buffer.h>",
    "tf2": "include <tf2/LinearMath/Quaternion.h>, <tf2/LinearMath/Transform.h> or <tf2/utils.h>",
    "ros": "it is a header of ROS 1; state `language: roscpp`",
    "laser_geometry": "compute the points from the ranges of the scan",
    "cv_bridge": "read sensor_msgs::msg::Image::data",
    "image_transport": "subscribe to sensor_msgs::msg::Image",
    "diagnostic_updater": "include <diagnostic_updater/diagnostic_updater.hpp>",
    "message_filters": "include <message_filters/subscriber.h>, <message_filters/synchronizer.h>, "
    "<message_filters/time_synchronizer.h> or <message_filters/cache.h>",
    "pcl_conversions": "read sensor_msgs::msg::PointCloud2::data",
    "pluginlib": "plug-ins are not loaded; create the object in your code",
    "nav2_util": "use rclcpp and rclcpp_action directly",
    "rosbag2_cpp": "record the run with `volery simulate`, which writes a bag",
    "rcl": "use rclcpp; the graph has no rcl",
    "rmw": "use rclcpp; the graph has no rmw",
}
"""Packages of ROS whose headers need the real libraries, and what to do instead."""


def _snake(label: str) -> str:
    """Return the name of the header of a type, as rosidl makes it: ``nav_sat_fix`` for ``NavSatFix``."""
    spaced = re.sub(r"(.)([A-Z][a-z]+)", r"\1_\2", label)
    return re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", spaced).lower()


def _file(package: str, kind: str, snake: str) -> str:
    return f"{package}/{kind}/{snake}.hpp"


class _Generator:
    """Writes the headers of types and of those that they contain."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self._known: dict[str, dict[str, str]] = {}
        for name in (*messages.types(), *messages.service_types(), *action_types()):
            package, kind, label = name.split("/")
            self._known.setdefault(f"{package}/{kind}", {})[_snake(label)] = label
        self.packages = {key.partition("/")[0] for key in self._known}

    def names(self, package: str, kind: str) -> list[str]:
        """Return the headers of a package."""
        return [f"{name}.hpp" for name in sorted(self._known.get(f"{package}/{kind}", {}))]

    def add(self, package: str, kind: str, snake: str) -> bool:
        """Add the header of a type; return whether there is such a type."""
        label = self._known.get(f"{package}/{kind}", {}).get(snake)
        if label is None:
            return False
        file = _file(package, kind, snake)
        if file not in self.texts:
            made = {"msg": self._message_file, "srv": self._service_file, "action": self._action_file}[kind]
            self.texts[file] = ""  # a type that contains itself ends here
            self.texts[file] = made(f"{package}/{kind}/{label}")
        return True

    def _message_file(self, full: str) -> str:
        return self._text(full, [full], [])

    def _service_file(self, full: str) -> str:
        kind = messages.service(full)
        label = full.rpartition("/")[2]
        return self._text(full, [kind.request.__msgtype__, kind.response.__msgtype__], _service(label, full))

    def _action_file(self, full: str) -> str:
        package, _, label = full.split("/")
        parts = [f"{package}/msg/{label}_{part}" for part in ("Goal", "Result", "Feedback")]
        halves = [
            f"{full}_{call}_{half}" for call in ("SendGoal", "GetResult") for half in ("Request", "Response")
        ]
        lines = [
            *_service(f"{label}_SendGoal", f"{full}_SendGoal"),
            *_service(f"{label}_GetResult", f"{full}_GetResult"),
        ]
        lines += [f"struct {label} {{"]
        lines += [
            f"    using {part} = {package}::msg::{label}_{part};" for part in ("Goal", "Result", "Feedback")
        ]
        lines += ["    struct Impl {", f"        using SendGoalService = {label}_SendGoal;"]
        lines += [f"        using GetResultService = {label}_GetResult;"]
        lines += [f"        using FeedbackMessage = {label}_FeedbackMessage;", "    };", "};", ""]
        return self._text(full, [*parts, *halves, f"{full}_FeedbackMessage"], lines)

    def _text(self, full: str, structs: Sequence[str], after: Sequence[str]) -> str:
        package, kind, _ = full.split("/")
        layouts = [ros2_layout(name) for name in structs]
        own = set(structs)
        nested = dict.fromkeys(
            field.nested
            for layout in layouts
            for field in layout.fields
            if field.nested and field.nested not in own
        )
        lines = [
            f"// Generated from the definition of {full}.",
            "#pragma once",
            '#include "rclcpp/message.hpp"',
        ]
        lines += [f'#include "{self._include(name)}"' for name in nested]
        lines += [line for layout in layouts for line in _struct(layout)]
        lines += ["", f"namespace {package}::{kind} {{", "", *after, f"}}  // namespace {package}::{kind}"]
        return "\n".join([*lines, ""])

    def _include(self, full: str) -> str:
        package, kind, label = full.split("/")
        self.add(package, kind, _snake(label))
        return _file(package, kind, _snake(label))


def _service(label: str, full: str) -> list[str]:
    return [
        f"struct {label} {{",
        f"    using Request = {label}_Request;",
        f"    using Response = {label}_Response;",
        f'    static const char* name_() {{ return "{full}"; }}',
        "};",
        "",
    ]


def _struct(layout: MessageLayout) -> list[str]:
    package, kind, label = layout.name.split("/")
    lines = ["", f"namespace {package}::{kind} {{", ""]
    # The parameter is whether members are initialised, which they always are here.
    lines += [f"struct {label} : volery::MessageOf<{label}> {{"]
    lines += [
        f"    {label}() = default;",
        f"    explicit {label}(rosidl_runtime_cpp::MessageInitialization) {{}}",
    ]
    lines += constant_lines(layout, _TYPES.__getitem__)
    lines += [f"    {_type(field)} {field.name}{_initial(field)};" for field in layout.fields]
    for one in layout.fields:
        lines += [f"    using _{one.name}_type = {_type(one)};"]
        lines += [f"    {label}& set__{one.name}(const _{one.name}_type& value) {{"]
        lines += [f"        return this->{one.name} = value, *this;", "    }"]
    lines += [*visit_lines(layout), "};", "using volery::message_operators::to_yaml;", ""]
    lines += [f"template <class Allocator>\nusing {label}_ = {label};", ""]
    return [*lines, f"}}  // namespace {package}::{kind}"]


def _type(one: FieldLayout) -> str:
    single = _TYPES[one.base] if one.base else f"::{one.nested.replace('/', '::')}"
    if one.length is None:
        return single
    return f"std::array<{single}, {one.length}>" if one.length else f"std::vector<{single}>"


def _initial(one: FieldLayout) -> str:
    if one.default is None or one.nested:
        return "{}"
    if one.length is None:
        return f"{{{_literal(one.default, _TYPES[one.base])}}}"
    values: Iterable[Any] = one.default
    inner = ", ".join(_literal(value, _TYPES[one.base]) for value in values)
    return f"{{{{{inner}}}}}" if one.length else f"{{{inner}}}"


def _literal(value: Any, kind: str) -> str:
    if isinstance(value, str):
        return text_literal(value)
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return f"static_cast<{kind}>({text})"
