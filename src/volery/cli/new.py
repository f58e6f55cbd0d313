"""``volery new``: a small model that runs."""

from __future__ import annotations

import shutil
from pathlib import Path

from volery.base.errors import UsageError
from volery.cli.console import Output
from volery.cli.endings import OK
from volery.cli.folders import example


def new(output: Output, folder: Path) -> int:
    """Copy the starter into *folder*, which must be new or empty."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} is there already and is not an empty folder; choose another name")
    starter = example("starter")
    try:
        shutil.copytree(starter, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    except OSError as error:
        raise UsageError(f"cannot write {folder}: {error.strerror or error}") from error
    output.show(
        f"made {folder}: a model, two components and a mission",
        f"  volery model check {folder}",
        f"  volery simulate {folder}",
        f"  volery fly {folder / 'mission.py'} --on sim:ardupilot",
    )
    return OK
