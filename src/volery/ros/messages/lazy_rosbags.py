"""The parts of rosbags that message types need, imported at the first use of a message.

A driver that reaches its vehicle over ROS or over MAVLink imports ``volery.ros``. Over MAVLink it needs no
rosbags.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from volery.base.installed import require_extra

if TYPE_CHECKING:
    from rosbags.interfaces import Msgdef, Nodetype
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
    from rosbags.typesys.base import TypesysError, normalize_fieldname
    from rosbags.typesys.store import Typestore

__all__ = [
    "Msgdef",
    "Nodetype",
    "SerdeError",
    "Stores",
    "Typestore",
    "TypesysError",
    "get_types_from_idl",
    "get_types_from_msg",
    "get_typestore",
    "normalize_fieldname",
]

_MODULES = {
    "Nodetype": "rosbags.interfaces",
    "SerdeError": "rosbags.serde",
    "Stores": "rosbags.typesys",
    "TypesysError": "rosbags.typesys.base",
    "get_types_from_idl": "rosbags.typesys",
    "get_types_from_msg": "rosbags.typesys",
    "get_typestore": "rosbags.typesys",
    "normalize_fieldname": "rosbags.typesys.base",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(name)
    require_extra("ros", "ROS messages")
    value = globals()[name] = getattr(import_module(_MODULES[name]), name)
    return value
