"""Function calls between a user's call and its effect, and the time they take.

Two paths are measured, each as a user's program takes it:

* publish: ``publisher.publish(message)`` in one rospy component to the first line of the callback in another,
  on the embedded graph; with both components on a processor (priced) and on none (unpriced).
* goto: ``Drone.goto`` on ``sim:ardupilot`` to the first frame that is handed to the link.

Calls of Python functions of volery are counted with ``sys.setprofile``. Times are medians over repetitions
that are not traced; with ``--against`` the least median of three alternating processes each, since other
programs may run on this machine. Only the public interface is used, so the same file measures any checkout:

    python bench/call_paths.py [--against /path/to/another/checkout/src] [--list publish]
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType, SimpleNamespace

import volery
from volery import AMSL, Drone, Position

Figures = dict[str, dict[str, float]]

SOURCE = Path(str(volery.__file__)).parent
MESSAGES, GOTOS = 3000, 40
ROUNDS = 3
WARM_UP, TRACED = 200, 20
"""Messages before measuring begins, and how many of the last ones are traced."""

TALKER = """
import sys
import rospy
from std_msgs.msg import String
probe = sys.modules["call_paths_probe"]
rospy.init_node("talker")
publisher = rospy.Publisher("words", String, queue_size=5)
rospy.sleep(1.0)
for _ in range(probe.count):
    message = String("a word")
    probe.begin()
    publisher.publish(message)
    rospy.sleep(0.1)
"""
LISTENER = """
import sys
import rospy
from std_msgs.msg import String
probe = sys.modules["call_paths_probe"]
rospy.init_node("listener")
rospy.Subscriber("words", String, lambda message: probe.end())
rospy.spin()
"""
PRICED = """
volery: 1
name: call-paths
components:
  Talker:
    {language: rospy, path: talker.py, active: true, at: {processor: intel-i5-3470, frequency: 3000 MHz},
     activation: {time: 0.1 ms}}
  Listener:
    {language: rospy, path: listener.py, active: true, at: {processor: intel-i5-3470, frequency: 3000 MHz},
     activation: {time: 0.1 ms}}
application:
  talker: {is: Talker}
  listener: {is: Listener}
platform:
  processors: {host: {is: intel-i5-3470, frequency: 3000 MHz}}
allocations:
  only: {talker: host, listener: host}
environment:
  origin: {latitude: 43.47, longitude: -3.8}
run: {duration: 10 min}
"""
UNPRICED = """
volery: 1
name: call-paths
components:
  Talker: {language: rospy, path: talker.py, active: true}
  Listener: {language: rospy, path: listener.py, active: true}
environment:
  origin: {latitude: 43.47, longitude: -3.8}
  components:
    talker: {is: Talker}
    listener: {is: Listener}
run: {duration: 10 min}
"""


class Probe:
    """Measures from ``begin`` to ``end``, called by the components."""

    def __init__(
        self, count: int, traced: frozenset[int], called: Callable[[FrameType], None] | None = None
    ) -> None:
        self.count = count
        self._called = called
        self._traced = traced
        self._number = 0
        self._started = 0
        self._path: list[tuple[str, str]] = []
        self.paths: list[list[tuple[str, str]]] = []
        self.times_us: list[float] = []

    def begin(self) -> None:
        """Start one measurement, traced or timed."""
        if self._number in self._traced:
            self._path = []
            sys.setprofile(self._note)
        self._started = time.perf_counter_ns()

    def end(self) -> None:
        """End the measurement."""
        ended = time.perf_counter_ns()
        if self._started == 0:
            return
        sys.setprofile(None)
        if self._number in self._traced:
            self.paths.append(self._path[:-1] if self._path and self._path[-1][1] == "end" else self._path)
        elif self._number >= WARM_UP or self.count < WARM_UP:
            self.times_us.append((ended - self._started) / 1000)
        self._started = 0
        self._number += 1

    def _note(self, frame: FrameType, event: str, argument: object) -> None:
        if event == "call":
            code = frame.f_code
            if code.co_filename.startswith(str(SOURCE)):
                self._path.append((str(Path(code.co_filename).relative_to(SOURCE)), code.co_qualname))
                if self._called is not None:
                    self._called(frame)


def publish(model: str) -> Probe:
    """Measure publish to callback in *model*."""
    probe = Probe(MESSAGES, frozenset(range(MESSAGES - TRACED, MESSAGES)))
    sys.modules["call_paths_probe"] = SimpleNamespace(  # type: ignore[assignment]  # the components import it
        begin=probe.begin, end=probe.end, count=probe.count
    )
    with TemporaryDirectory() as folder:
        for name, text in {"talker.py": TALKER, "listener.py": LISTENER, "model.yaml": model}.items():
            Path(folder, name).write_text(text)
        volery.simulate(folder)
    return probe


def goto() -> Probe:
    """Measure ``Drone.goto`` to the first frame."""

    def notice(frame: FrameType) -> None:
        """End a traced measurement at the link's ``send``; the following ones end there, too."""
        if frame.f_code.co_name == "send" and Path(frame.f_code.co_filename).parent.name == "links":
            link = type(frame.f_locals["self"])
            send = link.send

            def noticed(self: object, frame: object) -> None:
                probe.end()
                send(self, frame)

            probe.end()
            link.send = noticed

    probe = Probe(GOTOS + 1, frozenset({0}), notice)

    def mission(drone: Drone) -> None:
        drone.takeoff(10)
        for number in range(probe.count):
            target = Position(46.0826 + 0.0001 * (number % 2), -103.8995, AMSL(915))
            probe.begin()
            drone.goto(target)
        drone.land()

    volery.fly(mission, "sim:ardupilot")
    return probe


def summary(probe: Probe) -> dict[str, float]:
    """Return the figures of one path."""
    path = sorted(probe.paths, key=len)[len(probe.paths) // 2]
    files = [file for file, _ in path]
    return {
        "calls": len(path),
        "functions": len(set(path)),
        "files": len(set(files)),
        "changes": sum(one != after for one, after in itertools.pairwise(files)),
        "us": round(statistics.median(probe.times_us), 1),
    }


PATHS: dict[str, Callable[[], Probe]] = {
    "publish, priced": lambda: publish(PRICED),
    "publish, unpriced": lambda: publish(UNPRICED),
    "goto": goto,
}


def measured_in(source: Path) -> Figures:
    """Return the figures of the checkout with this src folder, measured in a process of its own."""
    own = source.parent / ".venv" / "bin" / "python"  # entry points are those of its installation
    environment = {**os.environ, "PYTHONPATH": str(source), "PYTHONSAFEPATH": "1"}
    command = [str(own) if own.exists() else sys.executable, __file__, "--json"]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    result: Figures = json.loads(done.stdout)
    return result


def best(rounds: list[Figures]) -> Figures:
    """Return the figures of the first round with the least time of all rounds."""
    return {name: {**one, "us": min(each[name]["us"] for each in rounds)} for name, one in rounds[0].items()}


def show(figures: Figures, other: Figures | None = None) -> None:
    """Print the table; with *other*, the other checkout's figures and the ratio."""
    print(f"{'path':<20}{'calls':>8}{'functions':>11}{'files':>7}{'changes':>9}{'us':>9}")
    for name, one in figures.items():
        rows = [(name, one)]
        if other is not None:
            ratio = {key: round(value / other[name][key], 2) for key, value in one.items()}
            rows += [("  against", other[name]), ("  ratio", ratio)]
        for label, row in rows:
            print(
                f"{label:<20}{row['calls']:>8}{row['functions']:>11}{row['files']:>7}"
                f"{row['changes']:>9}{row['us']:>9}"
            )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--against", metavar="SRC", help="src folder of another checkout to compare with")
    parser.add_argument("--list", metavar="PATH", choices=PATHS, help="print the calls of one path")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")
    given = parser.parse_args()
    if given.list:
        path = sorted(PATHS[given.list]().paths, key=len)
        for number, (file, function) in enumerate(path[len(path) // 2], 1):
            print(f"{number:4} {file:<50} {function}")
        return
    if given.against:
        pairs = [(measured_in(SOURCE.parent), measured_in(Path(given.against))) for _ in range(ROUNDS)]
        show(best([here for here, _ in pairs]), best([there for _, there in pairs]))
        return
    figures = {name: summary(measure()) for name, measure in PATHS.items()}
    if given.json:
        print(json.dumps(figures))
    else:
        show(figures)


if __name__ == "__main__":
    main()
