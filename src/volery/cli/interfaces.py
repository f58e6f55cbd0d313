"""``volery interfaces``: packages of messages and services for ROS 1's own tools."""

from __future__ import annotations

from pathlib import Path

from volery.cli.console import Output
from volery.cli.endings import OK
from volery.ros.transports.ros1.package_export import write_package


def interfaces(output: Output, packages: list[str], folder: Path) -> int:
    """Write them below *folder*; the exit status."""
    for package in packages:
        output.show(f"written: {write_package(package, folder)}")
    output.show(f"for ROS 1's tools: export PYTHONPATH={folder.resolve()}:$PYTHONPATH")
    return OK
