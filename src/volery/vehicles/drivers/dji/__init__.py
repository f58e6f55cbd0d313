"""DJI aircraft behind the ROS node of their onboard SDK: ``dji_sdk`` 3.8 or ``dji_osdk_ros`` 4.1.

The driver follows public definitions and what users report, and has not been flown by us; ``driver.ASSUMED``
lists the assumptions, ``driver.DOCUMENTED`` what has a source.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import nan

from volery.base.errors import UsageError, choices
from volery.kernel.api import Kernel
from volery.ros.graph import Node
from volery.ros.messages.dji_constants import NEW_NAMES, OLD_NAMES
from volery.vehicles.address import check_options, records_texts
from volery.vehicles.driver import DriverFactory
from volery.vehicles.drivers.dji.backend import DjiBackend
from volery.vehicles.drivers.dji.driver import Dji
from volery.vehicles.drivers.dji.node_interfaces import DjiSdkInterface, OsdkRosInterface, SdkRequests

__all__ = ["DRIVER", "Dji", "open_driver"]

OPTIONS = ("home_altitude", "names", "namespace", "texts")
HIGHEST_HOME_M = 9_000.0
NAMES: Mapping[str, Callable[[Node, str], SdkRequests]] = {
    OLD_NAMES: DjiSdkInterface,
    NEW_NAMES: OsdkRosInterface,
}


def open_driver(kernel: Kernel, node: Node, name: str, options: Mapping[str, str]) -> Dji:
    """Open a DJI aircraft behind its ROS node; it is subscribed to from now on.

    Args:
        kernel: clock and tasks.
        node: the node that commands the vehicle.
        name: name of the vehicle.
        options: ``namespace`` of the topics (default ``/dji_sdk``); ``names``: ``dji_sdk`` or
            ``dji_osdk_ros`` (default: the last part of the namespace, else ``dji_sdk``); ``home_altitude``:
            altitude of the place where the motors start, m AMSL, without which altitudes AMSL are refused;
            ``texts=unrecorded`` if the aircraft records its texts itself, as a simulated one does.

    Raises:
        UsageError: an option is unknown or its value is wrong.
    """
    check_options("dji", options, *OPTIONS)
    namespace = options.get("namespace", f"/{OLD_NAMES}").rstrip("/")
    last = namespace.rpartition("/")[2]
    names = options.get("names", last if last in NAMES else OLD_NAMES)
    if names not in NAMES:
        raise UsageError(f"names={names!r}; there is {choices(NAMES)}")
    backend = DjiBackend(
        kernel,
        node,
        name,
        NAMES[names](node, namespace),
        record=records_texts(options),
        home_altitude=_home_altitude(options),
    )
    return Dji(kernel, name, backend)


def _home_altitude(options: Mapping[str, str]) -> float:
    """Return the stated altitude of home, m AMSL; NaN if none is stated."""
    given = options.get("home_altitude")
    if given is None:
        return nan
    try:
        altitude = float(given)
    except ValueError:
        altitude = nan
    if not abs(altitude) <= HIGHEST_HOME_M:
        raise UsageError(f"home_altitude={given!r} is no altitude in m AMSL")
    return altitude


DRIVER = DriverFactory(
    on_graph=open_driver,
    namespace=f"/{{name}}/{OLD_NAMES}",
    graph_names=OLD_NAMES,
    home_option="home_altitude",
)
"""Only on a graph: the protocol of DJI aircraft is encrypted, and only DJI's own library implements it."""
