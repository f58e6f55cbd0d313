"""A rospy for each node.

rospy keeps its node in module globals, so a process can have one. Importing its modules anew gives another
set of globals that shares nothing with the first but the message classes; the modules hold on to each other
from their import on, so both work side by side.
"""

from __future__ import annotations

import importlib
import sys
import threading
from importlib.util import find_spec
from types import ModuleType
from typing import Any

from volery.base.errors import UsageError

_importing = threading.Lock()
_MISSING = (
    "ROS 1 needs rospy, which this Python does not see: on Debian install python3-rospy, then run "
    "scripts/ros1-modules VENV for the virtual environment"
)


def available() -> bool:
    """Whether rospy can be imported."""
    return find_spec("rospy") is not None and find_spec("genpy") is not None


def rospy_copy() -> Any:
    """A rospy of one's own, its logging left to whoever has set it up. ``UsageError`` where there is none."""
    if not available():
        raise UsageError(_MISSING)
    with _importing:
        before = _take_out()
        try:
            made: Any = importlib.import_module("rospy")
            importlib.import_module("rospy.impl.registration")
        except ImportError as error:
            raise UsageError(f"rospy is there but cannot be imported: {error}") from error
        finally:
            _take_out()
            sys.modules.update(before)
    made.core.configure_logging = lambda *ignored, **ignored_too: None
    return made


def _take_out() -> dict[str, ModuleType]:
    names = [name for name in sys.modules if name == "rospy" or name.startswith("rospy.")]
    return {name: sys.modules.pop(name) for name in names}
