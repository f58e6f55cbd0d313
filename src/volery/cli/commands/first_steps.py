"""``volery demo`` and ``volery new``: the examples that come with volery; ``volery doctor``: installed parts.

The demo runs the delivery service on two allocations at once, each in a process of its own and out of reach
of the terminal. A signal that ends this process is passed on to them as SIGTERM: each simulation ends in
order and this process waits for them. If this process is killed they receive SIGTERM, too. ``doctor`` lists
what each missing part would enable and how to install it.
"""

from __future__ import annotations

import multiprocessing
import os
import platform
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

import volery
from volery.base.errors import CapabilityError, UsageError, VoleryError
from volery.base.installed import install_command, require_extra
from volery.base.process import on_ending_signals
from volery.cli.command import FAILED, OK, Commands
from volery.cli.console import CommandOutput
from volery.cli.options import Seed
from volery.simulation.real_firmware.program_search import (
    USUAL_PROGRAMS,
    find_program,
    how_to_get,
    project_of,
)

if TYPE_CHECKING:
    from volery.cli.run_display import Drawings
    from volery.requirements.record import RunRecord
    from volery.run.result import RunProgress
    from volery.vehicles import Vehicle
    from volery.vehicles.firmware_versions import FirmwareVersion

commands = Commands()

DEMO_MODEL, STARTER_MODEL = "delivery", "starter"

IMPORTED_ONCE = (
    "networkx",  # of a component of the demo
    "volery.bridge",
    "volery.report.html_report",
    "volery.run.simulate",
    "volery.simulation.autopilots.ardupilot.copter",
    "volery.simulation.autopilots.ardupilot.rover",
    "volery.vehicles.drivers.ardupilot",
)
"""Modules that the processes of simulations share: nearly all that they import."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def example(name: str) -> Path:
    """Return the path of an example of the package, or of the checkout that contains the package."""
    package = Path(volery.__file__).parent
    for folder in (package / "examples", package.parents[1] / "examples"):
        if (folder / name).exists():
            return folder / name
    raise UsageError(f"this installation has no example {name!r}; install volery from a complete checkout")


@commands.add("quiet", "json", "debug")
def demo(
    output: CommandOutput,
    out: Annotated[Path, typer.Option(help="Folder for the run folders.")] = Path("runs/demo"),
    seed: Seed = 7,
) -> int:
    """Deliver three parcels across a city with two allocations side by side, and write a report.

    Exit status: 0 if both runs completed, even if a requirement was not met.
    """
    require_extra("simulation", "simulated runs")
    from volery.cli.run_display import unmet
    from volery.model.system_loader import load
    from volery.report.comparison_page import Comparison, read_side
    from volery.report.terminal import short_comparison
    from volery.run.assembly.model_checks import vocabulary
    from volery.run.recording import make_folder

    model = example(DEMO_MODEL)
    names = load(model, vocabulary()).allocations[:2]
    outcomes = run_all(
        output, {name: QueuedRun(model, name, seed, make_folder(out / name)) for name in names}
    )
    records = [outcome.record for outcome in outcomes.values()]
    noted = [
        f"{name}: {one.state} at {one.history[-1].at_s:.0f} s {one.history[-1].detail}".rstrip()
        for subjects in records[0].notes.values()
        for name, one in subjects.items()
    ]
    output.show(*noted, short_comparison(records, list(outcomes)))
    output.give(f"[{', '.join(record.model_dump_json(by_alias=True) for record in records)}]")
    for name, outcome in outcomes.items():
        for requirement, found in outcome.record.requirements.items():
            if found.met is False:
                output.note(f"{name}: {unmet(outcome.record, requirement)}")
        for problem in outcome.problems:
            output.complain(f"volery: {name}: {problem}")
        output.note(f"report: {outcome.folder / 'report.html'}")
    comparison = Comparison([read_side(outcome.folder) for outcome in outcomes.values()])
    output.note(f"side by side: {comparison.write(out)}")
    return OK if all(outcome.completed for outcome in outcomes.values()) else FAILED


@commands.add("quiet", "debug")
def new(
    output: CommandOutput, folder: Annotated[Path, typer.Argument(help="Folder to create; new or empty.")]
) -> int:
    """Create a small model that runs, to start from."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UsageError(f"{folder} exists and is not an empty folder; choose another name")
    starter = example(STARTER_MODEL)
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


# -- several simulations at once


@dataclass(frozen=True)
class QueuedRun:
    """A simulation to run at fidelity ``code``."""

    model: Path
    allocation: str
    seed: int
    out: Path


@dataclass(frozen=True)
class JobOutcome:
    """Result of a job. Unlike a ``Run`` it can be sent between processes."""

    record: RunRecord
    folder: Path
    problems: tuple[str, ...]

    @property
    def completed(self) -> bool:
        """True if the run completed and everything could be written."""
        return self.record.outcome.status == "completed" and not self.problems


def run_all(output: CommandOutput, jobs: Mapping[str, QueuedRun]) -> dict[str, JobOutcome]:
    """Run all *jobs* and return their outcomes by name. Raises the error of the first that cannot start."""
    from volery.cli.run_display import live_progress

    for module in IMPORTED_ONCE:
        import_module(module)
    context = multiprocessing.get_context("fork")  # before a thread draws
    started: dict[str, BaseProcess] = {}
    sending: dict[Connection, str] = {}
    stopped = False

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True
        for process in started.values():
            process.terminate()

    with on_ending_signals(stop):
        for name, job in jobs.items():
            ours, theirs = context.Pipe(duplex=False)
            sending[ours] = name
            process = context.Process(target=_work, args=(name, job, theirs, tuple(sending)), name=name)
            mask = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)  # until the child has its own handlers
            try:
                process.start()
                started[name] = process
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            theirs.close()
            if stopped:
                process.terminate()
        try:
            with live_progress(output) as drawings:
                outcomes = _outcomes(sending, drawings)
        except BaseException:
            for one in started.values():
                one.terminate()
            raise
        finally:
            for one in started.values():
                one.join()
    return {name: outcomes[name] for name in jobs}


def _outcomes(sending: Mapping[Connection, str], drawings: Drawings | None) -> dict[str, JobOutcome]:
    """Show the progress that processes send until each has sent its outcome, and return these by name."""
    outcomes: dict[str, JobOutcome] = {}
    while len(outcomes) < len(sending):
        for ready in wait([one for one, name in sending.items() if name not in outcomes]):
            assert isinstance(ready, Connection)
            name = sending[ready]
            try:
                sent = ready.recv()
            except EOFError:  # killed, for example for want of memory
                raise VoleryError(f"the process that simulated {name} was ended from outside") from None
            if isinstance(sent, JobOutcome):
                outcomes[name] = sent
            elif isinstance(sent, BaseException):
                raise sent
            elif drawings is not None:
                drawings.show(name, sent)
    return outcomes


def _work(name: str, job: QueuedRun, to: Connection, of_parent: Sequence[Connection]) -> None:
    """Run *job* in its own process, and send its progress and then its outcome or error.

    SIGTERM ends it, also when its parent ends. The kernel's own parent-death signal does not serve here: it
    is sent again for each thread of the parent, and a second signal would stop the run at once.
    """
    from volery.cli.run_display import RateLimited

    os.setpgid(0, 0)  # the terminal's signals reach the parent, which forwards them
    for one in of_parent:
        one.close()
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    threading.Thread(target=_end_with_parent, daemon=True).start()

    def send(content: object) -> None:
        with suppress(BrokenPipeError):  # the parent is gone
            to.send(content)

    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)  # may raise KeyboardInterrupt at once
        send(_run(job, RateLimited(send)))
    except BaseException as error:
        send(error)


def _end_with_parent() -> None:
    if parent := multiprocessing.parent_process():
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


def _run(job: QueuedRun, show: Callable[[RunProgress], None]) -> JobOutcome:
    from volery.run.result import Options
    from volery.run.simulate import simulate

    options = Options(fidelity="code", seed=job.seed, out=job.out, show=show)
    run = simulate(job.model, options, allocation=job.allocation)
    problems = [] if run.completed else [f"{run.record.outcome.status}: {run.record.outcome.reason}"]
    return JobOutcome(run.record, job.out, (*problems, *run.problems))


MINIMUM_PYTHON = (3, 11)


@dataclass(frozen=True)
class InstallablePart:
    """Something that may be installed.

    ``find`` returns a version or a path, or an empty text if the part is missing.
    """

    name: str
    find: Callable[[], str]
    enables: str
    get: str
    needed: bool = False


@dataclass(frozen=True)
class FoundPart:
    """A part and what was found of it; ``found`` is empty if it is missing."""

    name: str
    found: str
    needed: bool
    enables: str
    get: str


def distribution(name: str) -> Callable[[], str]:
    """Return a function that finds a Python package by the name it is installed under."""

    def find() -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return ""

    return find


def module(name: str) -> Callable[[], str]:
    """Return a function that finds a Python module of any origin, such as Debian's."""

    def find() -> str:
        spec = find_spec(name)
        return (spec.origin or "installed") if spec else ""

    return find


def program(*names: str) -> Callable[[], str]:
    """Return a function that finds a program by any of *names*."""
    return lambda: next((found for name in names if (found := shutil.which(name))), "")


def _firmware(name: str) -> InstallablePart:
    def find() -> str:
        try:
            return str(find_program(name))
        except UsageError:
            return ""

    enables = f"real firmware in virtual time: --fidelity firmware, firmware:{project_of(name)}"
    return InstallablePart(name, find, enables, how_to_get(name))


def _python() -> str:
    return platform.python_version() if sys.version_info >= MINIMUM_PYTHON else ""


def _core(name: str, enables: str) -> InstallablePart:
    return InstallablePart(name, distribution(name), enables, f"pip install {name}", needed=True)


def _optional(name: str, extra: str, enables: str) -> InstallablePart:
    return InstallablePart(name, distribution(name), enables, install_command(extra))


PARTS: tuple[InstallablePart, ...] = (
    InstallablePart("Python 3.11 or newer", _python, "everything", "apt install python3", needed=True),
    _core("greenlet", "code that blocks, in virtual time"),
    _core("numpy", "arrays"),
    _core("pymavlink", "MAVLink: ArduPilot, PX4 and ground stations"),
    _core("pyserial", "radios and cables to real vehicles"),
    _core("mcap", "traces that Foxglove opens"),
    _core("pydantic", "run records and cost laws"),
    _core("shapely", "geofences"),
    _optional("numba", "simulation", "simulated vehicles, and the cost of C++ code on another processor"),
    _optional("ruamel.yaml", "model", "models and catalogues of processors"),
    _optional("rosbags", "ros", "ROS messages and bags, also without ROS"),
    _optional("jinja2", "report", "HTML reports"),
    InstallablePart(
        "mavsdk",
        distribution("mavsdk"),
        "to fly `volery vehicle serve` with MAVSDK",
        "pip install 'mavsdk>=3,<4'",
    ),
    InstallablePart(
        "MAVProxy",
        distribution("MAVProxy"),
        "to fly `volery vehicle serve` by typing",
        "pip install MAVProxy",
    ),
    InstallablePart(
        "rospy", module("rospy"), "real ROS 1: the bridge, --graph ros1", "apt install python3-rospy"
    ),
    InstallablePart(
        "rclpy", module("rclpy"), "real ROS 2: the bridge, --graph ros2", "source your ROS 2 set-up"
    ),
    InstallablePart(
        "g++ or clang++",
        program("g++", "clang++"),
        "components in C++ (language c++, roscpp or rclcpp)",
        "apt install g++",
    ),
    InstallablePart(
        "LLVM 17 to 19",
        program("opt-19", "opt-18", "opt-17", "opt"),
        "cost of C++ code on another processor",
        "apt install clang-19 llvm-19",
    ),
    *(_firmware(name) for name in USUAL_PROGRAMS),
    InstallablePart(
        "addr2line", program("addr2line"), "the line where a C++ component crashed", "apt install binutils"
    ),
    InstallablePart(
        "a browser",
        program("chromium", "chromium-browser", "google-chrome", "firefox"),
        "to open report.html",
        "apt install chromium",
    ),
)


VehicleUrl = Annotated[
    str | None, typer.Option("--vehicle", metavar="URL", help="Show the firmware that answers there.")
]


@commands.add("json", "debug")
def doctor(output: CommandOutput, vehicle: VehicleUrl = None) -> int:
    """Show which parts are installed, what each missing part would enable, and how to install it.

    With --vehicle: which firmware answers there, and how this driver was tried with its version.
    Exit status: 0 if no necessary part is missing, 1 otherwise.
    """
    if vehicle is not None:
        return _vehicle(output, vehicle)
    findings = [FoundPart(part.name, part.find(), part.needed, part.enables, part.get) for part in PARTS]
    for one in findings:
        output.show(_line(one))
    missing = [finding.name for finding in findings if finding.needed and not finding.found]
    output.show(f"missing: {', '.join(missing)}" if missing else "every necessary part is installed")
    output.give({"ok": not missing, "parts": [asdict(finding) for finding in findings]})
    return FAILED if missing else OK


def _vehicle(output: CommandOutput, url: str) -> int:
    """Show which firmware answers at an address, and what is known about its version."""
    from volery.run.connect import attach
    from volery.vehicles import Drone, Rover
    from volery.vehicles.tried_versions import row_of, tried

    try:
        autopilot, version = _stated(attach(url, Drone))
    except CapabilityError:  # a rover, which is all the same here
        autopilot, version = _stated(attach(url, Rover))
    output.show(tried(autopilot, version))
    row = row_of(autopilot, version)
    output.give(
        {
            "autopilot": autopilot,
            "version": str(version) if version is not None else "",
            "row": row._asdict() | {"known": [one.value for one in row.known]} if row is not None else None,
        }
    )
    return OK


def _stated(attached: Vehicle) -> tuple[str, FirmwareVersion | None]:
    """Return autopilot and version of a vehicle that is attached for this."""
    with attached as vehicle:
        seen = vehicle.telemetry
        vehicle.wait_for_version()
        return seen.autopilot, seen.version


def _line(one: FoundPart) -> Text:
    if one.found:
        return Text.assemble(
            ("✓ ", "green"), (f"{one.name} ", "bold"), one.found, (f"  {one.enables}", "dim")
        )
    mark = ("✗ ", "bold red") if one.needed else ("· ", "yellow")
    return Text.assemble(mark, (f"{one.name} ", "bold"), "missing", f"  {one.enables}: ", (one.get, "cyan"))
