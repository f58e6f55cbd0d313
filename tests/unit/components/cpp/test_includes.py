"""C and C++ files include files of their own package and of lower packages only."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[4]
PACKAGE = ROOT / "src" / "volery"
SUFFIXES = {".c", ".cpp", ".h", ".hpp"}


def layers() -> dict[str, int]:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    [layered] = [one for one in contracts["contracts"] if one.get("containers") == ["volery"]]
    return {
        name.strip(): level
        for level, names in enumerate(reversed(layered["layers"]))
        for name in names.split("|")
    }


def test_includes_point_down_only():
    files = [file for file in PACKAGE.rglob("*") if file.suffix in SUFFIXES]
    found = {}
    for file in files:
        for name in re.findall(r'#\s*include\s*"([^"]+)"', file.read_text(encoding="utf-8")):
            targets = [one for one in files if one.as_posix().endswith(f"/{name}")]
            found[file, name] = {one.relative_to(PACKAGE).parts[0] for one in targets}
    level = layers()
    upward = {
        (str(file.relative_to(PACKAGE)), name)
        for (file, name), packages in found.items()
        if packages and min(level[one] for one in packages) > level[file.relative_to(PACKAGE).parts[0]]
    }
    assert any(found.values())
    assert upward == set()
