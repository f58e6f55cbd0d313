"""The command line of a node as ``roslaunch`` and ``ros2 launch`` write it, for a bridge in MAVROS's place.

Parameters have MAVROS's names and meaning (``fcu_url``, ``tgt_system`` …). ROS 1 puts those of a launch file
on its parameter server, ROS 2 into files.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from volery.base.errors import LinkError, UsageError
from volery.exchange.launch.launch_reading import UnresolvedError, joined
from volery.exchange.launch.ros2_actions import parameters_of
from volery.ros.client_libraries.library_base import Launch
from volery.run.bridge import BridgeOptions
from volery.vehicles.address import IN_VIRTUAL_TIME

ROS_2 = "--ros-args"
NODE = "mavros"
"""Name of MAVROS's node where none is given."""
_PATIENCE_S = 2.0
_SHOWN = 8
_PARAMETER_FILE = "--params-file"
_SERIAL = re.compile(r"(?:serial(?:-hwfc)?://)?(/[^:?]+)(?::(\d+))?(?:[/?].*)?$")
_UDP = re.compile(r"udp(?:-b|-pb)?://([^:@/?]*)(?::(\d+))?@([^:@/?]*)(?::(\d+))?(?:/.*)?(?:\?.*)?$")
_TCP = re.compile(r"tcp(-l)?://([^:@/?]*)(?::(\d+))?(?:/.*)?(?:\?.*)?$")
_BAUD, _UDP_BIND, _UDP_REMOTE, _TCP_PORT = 57_600, 14_555, 14_550, 5_760


@dataclass(frozen=True)
class NodeArguments:
    """The arguments that a launcher gives a node.

    Attributes:
        words: The command line without what is for ROS.
        name: Name of the node; empty if none is given.
        namespace: Its namespace.
        parameters: Parameters, with their values.
        remaps: Names and their replacements.
        ros: Version of ROS whose launcher wrote it; 0 if nothing in it is for ROS.
    """

    words: tuple[str, ...]
    name: str = ""
    namespace: str = "/"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    remaps: Mapping[str, str] = field(default_factory=dict)
    ros: int = 0

    def full_name(self) -> str:
        """Return the name of the node with its namespace."""
        return joined(self.namespace, self.name or NODE)


def node_arguments(words: Sequence[str]) -> NodeArguments:
    """Return the arguments for a node in a command line: ``__name:=``, ``_parameter:=``, ``--ros-args …``.

    Raises:
        UsageError: A file of parameters cannot be read.
    """
    ros_2 = ROS_2 in words
    if not ros_2 and not any(":=" in word for word in words):
        return NodeArguments(tuple(words))
    ros = 2 if ros_2 else 1
    above = os.environ.get("ROS_NAMESPACE", "") if ros == 1 else ""  # where roslaunch states it
    launch = Launch(joined("/", above)).given(words, ros)
    arguments = NodeArguments(
        tuple(_own(words, ros)), launch.node_name, launch.namespace, launch.parameters, launch.remaps, ros
    )
    parameters: dict[str, Any] = {}
    for file in _parameter_files(words) if ros_2 else ():
        try:
            own, _ = parameters_of(Path(file), arguments.full_name())
            parameters |= own
        except UnresolvedError as error:
            raise UsageError(f"{_PARAMETER_FILE} {file}: {error}") from None
    return replace(arguments, parameters={**parameters, **launch.parameters})


def with_server_parameters(given: NodeArguments) -> NodeArguments:
    """Return *given* with the parameters that a launch file of ROS 1 has put on the parameter server.

    Those of the command line win. Nothing is added where no master answers.
    """
    from volery.ros.transports.ros1.master import Master, uri_of_master  # noqa: PLC0415  # of ROS 1 only

    if given.ros != 1:
        return given
    master = Master(uri_of_master(), given.full_name(), _PATIENCE_S)
    try:
        found, _, values = master.ask("getParam", given.full_name())
    except LinkError:
        return given
    stated = values if found == 1 and isinstance(values, dict) else {}
    return replace(given, parameters={**stated, **given.parameters})


def _own(words: Iterable[str], ros: int) -> Iterable[str]:
    """Yield the words that are not for ROS."""
    inside = False
    for word in words:
        if ros == 2 and word in (ROS_2, "--"):
            inside = word == ROS_2
        elif not inside and not (ros == 1 and ":=" in word):
            yield word


def _parameter_files(words: Sequence[str]) -> Iterable[str]:
    return [file for option, file in pairwise(words) if option == _PARAMETER_FILE]


def mavros_options(
    options: BridgeOptions, given: NodeArguments, note: Callable[[str], None]
) -> BridgeOptions:
    """Return the options of a bridge with the arguments that a launcher gives MAVROS.

    Args:
        options: What the command line states; an address there wins over ``fcu_url``.
        given: The arguments of the launcher.
        note: Called with a sentence about parameters that have no effect.

    Raises:
        UsageError: A parameter has a value that cannot be used.
    """
    url = options.url or str(given.parameters.get("fcu_url", ""))
    if not url:
        raise UsageError("no address is given: state it, or MAVROS's parameter fcu_url (_fcu_url:=…)")
    system = _whole(given, "target_system_id", "tgt_system")
    in_virtual_time = url.partition(":")[0] in IN_VIRTUAL_TIME
    if "+" not in url.partition(":")[0] and not in_virtual_time:
        url = volery_address(url, str(given.parameters.get("autopilot", "px4")))
    if system is not None and "system=" not in url and not in_virtual_time:
        url += f"{'&' if '?' in url else '?'}system={system}"
    own = _whole(given, "system_id")
    stated = {"fcu_url", "autopilot", "target_system_id", "tgt_system", "system_id", "use_sim_time"}
    others = sorted(
        name for name, value in given.parameters.items() if name not in stated and value not in ("", None)
    )
    if others:
        listed = ", ".join(others[:_SHOWN]) + (", ..." if len(others) > _SHOWN else "")
        note(f"parameters of MAVROS without effect here: {listed}")
    below = given.full_name() if given.ros == 1 else given.namespace
    namespace = options.namespace or (below if below != "/" else "")
    return replace(
        options,
        url=url,
        namespace=namespace,
        system=options.system if own is None else own,
        remaps={**options.remaps, **given.remaps},
    )


def _whole(given: NodeArguments, *names: str) -> int | None:
    """Return the first of some parameters that is given, a number from 0 to 255."""
    for name in names:
        value = given.parameters.get(name)
        if value is not None:
            if not isinstance(value, int) or not 0 <= value <= 255:  # ids are bytes
                raise UsageError(f"the parameter {name} is {value!r}; a system id from 0 to 255 is expected")
            return value
    return None


def volery_address(fcu_url: str, autopilot: str) -> str:
    """Return MAVROS's *fcu_url* as an address: serial, ``udp://BIND@REMOTE``, ``tcp://`` or ``tcp-l://``.

    Raises:
        UsageError: It is of none of these forms.
    """
    serial, udp, tcp = (one.match(fcu_url) for one in (_SERIAL, _UDP, _TCP))
    if serial:
        return f"{autopilot}+serial://{serial[1]}?baud={serial[2] or _BAUD}"
    if udp:
        bound, port, host, remote = udp.groups()
        if host:
            return f"{autopilot}+udp://{host}:{remote or _UDP_REMOTE}?from={port or _UDP_BIND}"
        listening = f"{autopilot}+udp://:{port or _UDP_BIND}"
        return f"{listening}?bind={bound}" if bound not in ("", "0.0.0.0") else listening
    if tcp and not tcp[1]:
        return f"{autopilot}+tcp://{tcp[2] or 'localhost'}:{tcp[3] or _TCP_PORT}"
    raise UsageError(
        f"fcu_url {fcu_url!r}: /dev/DEVICE:BAUD, serial://, udp://[BIND:PORT]@[HOST:PORT] and "
        "tcp://HOST:PORT are understood, and addresses of volery"
    )
