"""Packages and programs that launch files name."""

from rigs.launch_files import write_package
from volery.components.package_search import PackageSearch


def test_programs_are_found_by_their_languages(tmp_path):
    package = write_package(
        tmp_path / "far",
        "mine",
        {"scripts/talk.py": "import rospy\n", "src/fly.cpp": "int main() { return 0; }\n"},
    )
    search, near = PackageSearch([tmp_path / "far"]), tmp_path / "a.launch"
    assert search.folder("mine", near) == package
    assert search.program("mine", "talk.py", near, 1) == (package / "scripts/talk.py", "rospy", "")
    assert search.program("mine", "fly", near, 2) == (package / "src/fly.cpp", "rclcpp", "")
    assert search.program("mine", "gone", near, 1) is None
    assert search.program("other", "talk.py", near, 1) is None
    assert search.package_of(package / "src/fly.cpp") == ("mine", package)
    assert PackageSearch().folder("mine", near) is None
