"""ROS message types: definitions, values and their encodings. The only package that imports rosbags.

Within one process a message is a value of the class that this package makes for its type, after the
definitions of the installed ROS 2 distribution (Jazzy without one); packages that rosbags lacks are in
``definitions/``. Messages of other definitions are converted. Depends on ``base`` only.
"""

from volery.ros.messages.client_classes import Library
from volery.ros.messages.encodings import (
    Ros1Service,
    Ros1Type,
    cdr_size,
    from_cdr,
    from_ros1,
    ros1_service,
    ros1_type,
    to_cdr,
    to_ros1,
)
from volery.ros.messages.message import RosMessage
from volery.ros.messages.packages import define_imported, define_packages, modules
from volery.ros.messages.store import (
    ServiceType,
    define,
    define_all,
    definition,
    message_class,
    message_name,
    new,
    request,
    service,
    service_name,
    service_types,
    type_hash,
    types,
)
from volery.ros.messages.workspace import Workspace

__all__ = [
    "Library",
    "Ros1Service",
    "Ros1Type",
    "RosMessage",
    "ServiceType",
    "Workspace",
    "cdr_size",
    "define",
    "define_all",
    "define_imported",
    "define_packages",
    "definition",
    "from_cdr",
    "from_ros1",
    "message_class",
    "message_name",
    "modules",
    "new",
    "request",
    "ros1_service",
    "ros1_type",
    "service",
    "service_name",
    "service_types",
    "to_cdr",
    "to_ros1",
    "type_hash",
    "types",
]
