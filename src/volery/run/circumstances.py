"""What differs from one execution of the same run to the next: wall time and versions. They go to
``run.json`` only.
"""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from time import perf_counter

from volery.requirements.accounts import Circumstances

_LIBRARIES = ("greenlet", "llvmlite", "numba", "numpy", "pymavlink", "rosbags", "mcap")


class Stopwatch:
    """Seconds of wall time since it was made."""

    def __init__(self) -> None:
        self._start = perf_counter()

    def seconds(self) -> float:
        """Seconds so far."""
        return perf_counter() - self._start


def own_version() -> str:
    """The version of this package; ``0`` if it is run without being installed."""
    try:
        return version("volery")
    except PackageNotFoundError:
        return "0"


def circumstances(watch: Stopwatch) -> Circumstances:
    """For the record of a run that *watch* was started with."""
    versions = {name: version(name) for name in _LIBRARIES}
    versions |= {
        "volery": own_version(),
        "python": platform.python_version(),
        "platform": f"{platform.system()} {platform.machine()}",
    }
    return Circumstances(watch.seconds(), versions)
