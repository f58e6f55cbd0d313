"""C++ headers of message and service types, generated from their definitions: ``std_msgs/String.h`` etc."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path

from volery.base.errors import UsageError
from volery.ros import messages
from volery.ros.client_libraries.cpp.message_structs import (
    BASES,
    SHARED_INCLUDE,
    constant_lines,
    refusal,
    visit_lines,
    with_ours,
)
from volery.ros.client_libraries.roscpp.config_headers import config_header
from volery.ros.messages.encodings import FieldLayout, MessageLayout, ros1_layout
from volery.ros.messages.store import ROS1_SPELLING, define_ros1_action

INCLUDE = Path(__file__).parent / "include"
_HEADER = re.compile(r"^(\w+)/(\w+)\.h$")
_CONFIG_HEADER = re.compile(r"^(\w+)/(\w+)Config\.h$")
_TIMES = {"builtin_interfaces/msg/Time": "ros::Time", "builtin_interfaces/msg/Duration": "ros::Duration"}


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
    if any(_CONFIG_HEADER.match(name) for name in includes):
        includes = [*includes, "dynamic_reconfigure/config_tools.h"]
    includes = with_ours(includes, INCLUDE)
    named = [found for name in includes if (found := _HEADER.match(name))]
    messages.define_packages(path, dict.fromkeys(found[1] for found in named))
    packages = {name.partition("/")[0] for name in (*messages.types(), *messages.service_types())}
    texts: dict[str, str] = {}
    for found in named:
        _add(texts, found[1], found[2])
    for name in includes:
        package = name.partition("/")[0]
        config = _CONFIG_HEADER.match(name)
        if config and name not in texts and name not in present:
            made = config_header(config[1], config[2], path)
            texts.update({} if made is None else {name: made})
        if name in texts or name in present or package == name or _offered(name):
            continue
        remedy = "no message or service of this name" if package in packages else _NOT_OFFERED.get(package)
        if remedy is not None:
            texts[name] = refusal(name, remedy)
    return texts


def _offered(name: str) -> bool:
    return (INCLUDE / name).exists() or (SHARED_INCLUDE / name).exists()


_OWN_PROCESS = "it needs threads or a process of its own; write it in Python, or leave this node out"
_NOT_OFFERED = {
    "ros": "include <ros/ros.h>, whose content docs/cpp-components.md lists",
    "tf": "include <tf/transform_listener.h>, <tf/transform_broadcaster.h> or <tf/transform_datatypes.h>",
    "tf2_ros": "include <tf2_ros/transform_listener.h>, <tf2_ros/transform_broadcaster.h>, "
    "<tf2_ros/static_transform_broadcaster.h> or <tf2_ros/buffer.h>",
    "tf2": "include <tf2/LinearMath/Quaternion.h>, <tf2/LinearMath/Transform.h> or <tf2/utils.h>",
    "actionlib": "include <actionlib/client/simple_action_client.h> or "
    "<actionlib/server/simple_action_server.h>",
    "message_filters": "include <message_filters/subscriber.h>, <message_filters/synchronizer.h>, "
    "<message_filters/time_synchronizer.h> or <message_filters/cache.h>",
    "dynamic_reconfigure": "include <dynamic_reconfigure/server.h>",
    "image_transport": "include <image_transport/image_transport.h>",
    "kdl_conversions": "use the types of tf2 or Eigen",
    "tf_conversions": "include <tf_conversions/tf_eigen.h>",
    "eigen_conversions": "include <eigen_conversions/eigen_msg.h>",
    "xmlrpcpp": "include <xmlrpcpp/XmlRpcValue.h>; the graph has no servers of XML-RPC",
    "laser_geometry": "compute the points from the ranges of the scan",
    "cv_bridge": "read sensor_msgs::Image::data",
    "pcl_ros": "read sensor_msgs::PointCloud2::data",
    "nodelet": _OWN_PROCESS,
    "pluginlib": _OWN_PROCESS,
    "mavros": "publish to the topics of MAVROS and call its services",
    "mavconn": "publish to the topics of MAVROS and call its services",
    "rosbag": "record the run with `volery simulate`, which writes a bag",
    "rclcpp": "it is a header of ROS 2; state `language: rclcpp`",
}
"""Packages of ROS whose headers need the real libraries, and what to do instead."""


def _add(texts: dict[str, str], package: str, label: str) -> None:
    if f"{package}/{label}.h" in texts:
        return
    ours = ROS1_SPELLING.get(package, {}).get(label, label)
    define_ros1_action(package, label)
    if f"{package}/srv/{ours}" in messages.service_types():
        _add_service(texts, package, label, ours)
        return
    for name in (f"{package}/msg/{ours}", *_halves(package, ours)):
        try:
            layout = ros1_layout(name)
        except UsageError:
            continue
        _add_message(texts, package, label, layout)
        return


def _halves(package: str, label: str) -> Iterable[str]:
    """Yield the names of the request or response that a label such as ``TriggerRequest`` may mean."""
    for ending in ("Request", "Response"):
        if label.endswith(ending):
            yield f"{package}/srv/{label.removesuffix(ending)}_{ending}"


def _add_service(texts: dict[str, str], package: str, label: str, ours: str) -> None:
    kind = messages.service(f"{package}/srv/{ours}")
    for ending, half in (("Request", kind.request), ("Response", kind.response)):
        _add_message(texts, package, f"{label}{ending}", ros1_layout(half.__msgtype__))
    texts[f"{package}/{label}.h"] = _SERVICE.format(package=package, label=label, name=kind.name)


_SERVICE = """\
// Generated from the definition of the service {package}/{label}.
#pragma once
#include "ros/message.h"
#include "{package}/{label}Request.h"
#include "{package}/{label}Response.h"

namespace {package} {{

struct {label} {{
    using Request = {label}Request;
    using Response = {label}Response;
    Request request;
    Response response;
    static const char* name_() {{ return "{name}"; }}
}};

}}  // namespace {package}
"""


def _add_message(texts: dict[str, str], package: str, label: str, layout: MessageLayout) -> None:
    nested = dict.fromkeys(
        field.nested for field in layout.fields if field.nested and field.nested not in _TIMES
    )
    texts[f"{package}/{label}.h"] = message_header(package, label, layout)
    for name in nested:
        inner_package, _, inner = _ros1(name).partition("/")
        _add(texts, inner_package, inner)


def _ros1(name: str) -> str:
    return ros1_layout(name).label


def message_header(package: str, label: str, layout: MessageLayout) -> str:
    """Return the text of ``package/label.h``."""
    nested = dict.fromkeys(
        field.nested for field in layout.fields if field.nested and field.nested not in _TIMES
    )
    lines = [
        f"// Generated from the definition of {layout.label}.",
        "#pragma once",
        '#include "ros/message.h"',
    ]
    lines += [f'#include "{_ros1(name)}.h"' for name in nested]
    lines += ["", f"namespace {package} {{", "", f"struct {label} {{"]
    lines += [f"    using Ptr = boost::shared_ptr<{label}>;"]
    lines += [f"    using ConstPtr = boost::shared_ptr<{label} const>;"]
    lines += constant_lines(layout, BASES.__getitem__)
    lines += [f"    {_type(field)} {field.name}{{}};" for field in layout.fields]
    lines += [*visit_lines(layout), "};", ""]
    lines += [f"using {label}Ptr = {label}::Ptr;", f"using {label}ConstPtr = {label}::ConstPtr;", ""]
    lines += [f"using ros::message_operators::operator{one};" for one in ("<<", "==", "!=")]
    return "\n".join([*lines, "", f"}}  // namespace {package}", ""])


def _type(one: FieldLayout) -> str:
    single = BASES[one.base] if one.base else _TIMES.get(one.nested) or _ros1(one.nested).replace("/", "::")
    if one.length is None:
        return single
    return f"boost::array<{single}, {one.length}>" if one.length else f"std::vector<{single}>"
