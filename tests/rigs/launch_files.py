"""Launch files in a workspace of packages, and what is read of them."""

from pathlib import Path

from volery.components.package_search import PackageSearch
from volery.exchange.launch.launch_model import read_launch


def write_package(folder: Path, name: str, files: dict[str, str]) -> Path:
    """Write a package with *files* by their paths; return its folder."""
    package = folder / name
    manifest = {"package.xml": f"<package format='3'><name>{name}</name></package>\n"}
    for path, text in (manifest | files).items():
        (package / path).parent.mkdir(parents=True, exist_ok=True)
        (package / path).write_text(text)
    return package


class LaunchBench:
    """A package ``mine`` in a workspace, the launch files of which are read."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "src"
        self.package = write_package(self.folder, "mine", {})

    def write(self, name: str, text: str) -> Path:
        """Write a file of the package and return its path."""
        path = self.package / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def read(self, name: str, text: str, **given: str):
        """Return what a launch file with this text starts."""
        return read_launch(self.write(f"launch/{name}", text), given, PackageSearch())

    def node(self, name: str, text: str, **given: str):
        """Return the only node of a launch file in which everything maps."""
        reading = self.read(name, text, **given)
        assert [str(one) for one in reading.notes if one.lost] == []
        (node,) = reading.nodes
        return node


def lost(reading) -> list[str]:
    """Return what was left out, with lines in place of whole paths."""
    return [f"{one.where.line}: {one.what}" for one in reading.notes if one.lost]
