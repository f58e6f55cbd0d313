"""The packages that a launch file names, and the sources of their programs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from volery.base.errors import UsageError
from volery.components.cpp.sources import executables
from volery.components.entry_points import entry_points, find_executable
from volery.exchange.launch.launch_reading import ProgramSource
from volery.ros.messages.workspace import Workspace

ROS_2 = 2


class PackageSearch:
    """Packages beside a file, in the workspace around it, in *folders*, and in a sourced workspace."""

    def __init__(self, folders: Iterable[Path] = ()) -> None:
        self._workspace = Workspace(*(one.resolve() for one in folders))

    def folder(self, package: str, near: Path) -> Path | None:
        """Return the folder of a package as the file *near* sees it, or None."""
        found = self._workspace.find(package, near)
        return None if found is None else found.folder

    def program(self, package: str, executable: str, near: Path, ros: int) -> ProgramSource | None:
        """Return the source of a program of a package for a version of ROS, or None."""
        for cpp, language in ((False, ("rospy", "rclpy")), (True, ("roscpp", "rclcpp"))):
            try:
                found = find_executable(self._workspace, package, executable, near, cpp=cpp)
            except UsageError:
                continue
            return ProgramSource(found.file, language[ros - 1], found.function)
        return None

    def package_of(self, file: Path) -> tuple[str, Path] | None:
        """Return name and folder of the package that *file* belongs to, or None."""
        found = self._workspace.package_of(file)
        return None if found is None else (found.name, found.folder)

    def executable_of(self, file: Path, ros: int) -> tuple[str, str] | None:
        """Return the package of a program's source and the name that ROS starts it by, or None."""
        package = self._workspace.package_of(file)
        if package is None:
            return None
        names: list[str] = []
        if file.suffix != ".py":
            built = executables(package)
            names = [name for name, source in built.items() if source.resolve() == file.resolve()]
        elif ros == ROS_2:
            names = [point.name for point in entry_points(package.folder) if point.is_in(file)]
        return package.name, (names or [file.name])[0]
