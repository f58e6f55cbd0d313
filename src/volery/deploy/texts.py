"""The parts of a deployment that ROS 1 and ROS 2 share: entry points, parameters, units of systemd, udev.

A model may come from another person, so none of its texts may become more than text where it is written: one
function quotes for each format. In Python that is ``repr``, also for docstrings.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

from volery.base.files import one_line
from volery.deploy.content import MODEL_FOLDER, Bridged, Computer, Hosted
from volery.model.system import System

Files = Mapping[Path, str]
"""Contents by the path in the folder of a package."""

MODEL_FILE = "model.yaml"
AUTOPILOT_USB = (
    ("26ac", "0011", "PX4 FMU v2 and older Pixhawks"),
    ("1209", "5740", "ArduPilot on ChibiOS"),
    ("2dae", "1016", "CubeOrange"),
    ("3162", "004b", "Holybro Pixhawk 4"),
    ("0403", "6015", "a telemetry radio behind an FT231X"),
)
"""Vendor and product of USB devices that are often an autopilot, as udev lists them."""


def unit_value(text: str) -> str:
    """Return *text* for a line of a systemd unit: no specifier, and no backslash that joins lines."""
    return one_line(text).replace("%", "%%").replace("\\", "/")


def xml_text(text: str) -> str:
    """Return *text* for the content of an XML element, without the controls that XML forbids."""
    return escape(one_line(text))


def markdown(text: str) -> str:
    """Return *text* for a line or a table of Markdown, without markup of its own."""
    return re.sub(r"([\\`*_{}\[\]<>()#|~!])", r"\\\1", one_line(text))


def host_script(hosted: Hosted, system: System, graph: str, model: str) -> str:
    """Return the entry point that hosts a component. *model* is the expression of its model's path."""
    one = hosted.instance
    code = one.component.path or "stub"
    if one.component.package:
        code = f"{one.component.package}/{one.component.executable}"
    what = (
        f"Hosts {one.name}, a {one.component.name} in {one.component.language}, from the unmodified {code}."
    )
    return f'''{what!r}

from pathlib import Path

from volery.run.distributed.host import main as host


def main() -> None:
    """Host the component until a signal, or until the simulation ends."""
    host({model}, {one.name!r}, graph={graph!r}, allocation={system.allocation!r}, scenario={system.scenario!r})


if __name__ == "__main__":
    main()
'''


def bridge_script(bridged: Bridged, graph: str) -> str:
    """Return the entry point of the node that serves a vehicle in reality."""
    url = f"{bridged.autopilot}+serial:///dev/{bridged.device}?baud=57600"
    what = f"Serves {bridged.vehicle} on the graph: the first argument is its address, by default {url}."
    return f'''{what!r}

import os
import sys


def main() -> None:
    """Bridge the autopilot until a signal."""
    given = [one for one in sys.argv[1:] if "://" in one]
    url = given[0] if given else {url!r}
    command = [sys.executable, "-c", "from volery.cli.main import main; main()", "bridge", url]
    os.execv(sys.executable, [*command, "--graph", {graph!r}, "--namespace", {bridged.namespace!r}])


if __name__ == "__main__":
    main()
'''


def verification_script(system: System, graph: str, model: str) -> str:
    """Return the entry point that simulates vehicles and environment for deployed components."""
    chosen = [text for name, value in (("--allocation", system.allocation), ("--scenario", system.scenario))
              if value for text in (name, value)]  # fmt: skip
    what = f"Simulates the vehicles and the environment of {system.name} for the components on the graph."
    return f'''{what!r}

import os
import sys
from pathlib import Path


def main() -> None:
    """Run until the goal of the scenario is reached. Options of `volery simulate` may follow."""
    own = [one for one in sys.argv[1:] if ":=" not in one and one != "--ros-args"]
    command = [sys.executable, "-c", "from volery.cli.main import main; main()", "simulate", str({model})]
    given = [*{chosen!r}, "--graph", {graph!r}, "--deployed", *own]
    os.execv(sys.executable, [*command, *given])


if __name__ == "__main__":
    main()
'''


def parameter_files(computer: Computer) -> Iterator[tuple[Path, str]]:
    """Yield the parameters of each hosted component, as YAML that may be edited on the computer."""
    for one in computer.hosted:
        head = f"# parameters of {one_line(one.instance.name)}; what is changed here wins over the model\n"
        lines = [f"{json.dumps(name)}: {_yaml(value)}\n" for name, value in one.instance.parameters.items()]
        yield Path("config") / f"{one.executable}.yaml", head + ("".join(lines) or "{}\n")


def _yaml(value: object) -> str:
    """Return a value in the JSON that is also YAML."""
    return json.dumps(value, ensure_ascii=False, default=list)


def system_files(computer: Computer, system: System, launch: str, setup: str) -> Iterator[tuple[Path, str]]:
    """Yield what is the same for both versions of ROS: parameters, systemd unit and udev rules.

    Args:
        computer: the computer.
        system: the system.
        launch: command that starts the package.
        setup: file of the workspace that is sourced first.
    """
    yield from parameter_files(computer)
    yield Path("systemd") / unit_name(computer), systemd_unit(computer, system, launch, setup)
    if computer.bridged:
        yield Path("udev") / f"99-{computer.package}.rules", udev_rules(computer)


def udev_rules(computer: Computer) -> str:
    """Return rules that give each autopilot a name that does not depend on the port."""
    lines = [
        "# Names for the autopilots of this computer. Adapt idVendor, idProduct or add the serial number of yours:",
        "#   udevadm info --query=property --name=/dev/ttyACM0",
        *(f"#   {vendor}:{product}  {what}" for vendor, product, what in AUTOPILOT_USB),
    ]
    for one in computer.bridged:
        lines.append(
            f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{AUTOPILOT_USB[1][0]}", '
            f'ATTRS{{idProduct}}=="{AUTOPILOT_USB[1][1]}", SYMLINK+="{one.device}", MODE="0660", GROUP="dialout"'
        )
    return "\n".join(lines) + "\n"


def systemd_unit(computer: Computer, system: System, launch: str, setup: str) -> str:
    """Return a unit that starts the computer's launch file at boot and restarts it after a failure."""
    title = unit_value(f"{system.name} on {computer.processor.name}")
    return f"""[Unit]
Description={title}
Wants=network-online.target
After=network-online.target

[Service]
Type=simple
# WORKSPACE, the user and the ROS variables are those of this computer: systemctl edit {unit_name(computer)}
Environment=WORKSPACE=/opt/{computer.package}
ExecStart=/bin/bash -c '. {setup} && exec {launch}'
KillSignal=SIGINT
TimeoutStopSec=600
Restart=on-failure
RestartSec=5

[Install]
WantedBy=multi-user.target
"""


def unit_name(computer: Computer) -> str:
    """Return the name of the computer's unit."""
    return f"{computer.package}.service"


def package_xml(
    name: str, system: System, what: str, tools: Sequence[str], dependencies: Sequence[str]
) -> str:
    """Return a package manifest of format 3; *tools* and *dependencies* are complete elements."""
    inner = "\n  ".join((*tools, *dependencies))
    return f"""<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>{xml_text(what)}</description>
  <maintainer email={quoteattr("maintainer@example.org")}>maintainer</maintainer>
  <license>see {xml_text(system.name)}</license>
  {inner}
</package>
"""


def model_expression(depth: int) -> str:
    """Return the Python expression of the model's path, for a file *depth* folders below the package."""
    return f'Path(__file__).resolve().parents[{depth}] / "{MODEL_FOLDER}" / "{MODEL_FILE}"'
