"""``simulate``: a model in virtual time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from volery.base.errors import CapabilityError, UsageError, choices
from volery.base.time import MS, Ns
from volery.components.cpp.build import build_framework
from volery.kernel.virtual import VirtualKernel
from volery.model.reader import load
from volery.model.system import System
from volery.requirements.verdicts import Observers
from volery.run.assembly.components import Builder, BuiltComponents
from volery.run.assembly.computers import Platform, PowerFeed
from volery.run.assembly.cpp import compile_all, has_cpp
from volery.run.assembly.faults import Affected, FleetLinks, inject, with_faulty_links
from volery.run.assembly.simulated_fleet import SimulatedFleet
from volery.run.assembly.vocabulary import vocabulary
from volery.run.distributed import DistributedRun, GraphSettings, HostPlatform, unallocated, without_computers
from volery.run.ending import Ending
from volery.run.progress import ProgressReporter
from volery.run.recording import Recording
from volery.run.recovery import recover_run
from volery.run.result import DEFAULT_OPTIONS, Options, Run
from volery.run.supervision import Supervision, run_supervised
from volery.run.trace_setup import attachments_of, setup_of
from volery.trace.attachments import RunSetup
from volery.trace.events import Text

FIDELITIES = ("times", "code")
LATER = ("firmware", "hardware")
WHO, WARNING = "volery", 4
"""Under this name and severity a run says what is doubtful about it."""

NOT_MODELLED = "its components compute on this machine and not on the model's processors"

PATIENCE_S = 30.0
"""Seconds on the wall that a component may compute without letting virtual time go on."""

GOAL_PERIOD: Ns = 100 * MS
"""How often it is looked whether the model's ``until`` holds."""


def simulate(
    model: System | str | Path,
    options: Options = DEFAULT_OPTIONS,
    *,
    scenario: str | None = None,
    allocation: str | None = None,
    overrides: Iterable[str] = (),
) -> Run:
    """Run *model* (a file, a folder with a ``model.yaml``, or a ``System``) in virtual time.

    The same model, options and seed give the same trace, byte for byte. ``scenario``, ``allocation`` and
    ``overrides`` (``path=value``) choose a variant of a model that is read from a file.

    Raises ``ModelError`` and ``UsageError`` before anything has started; what happens later is in the
    ``Run``.
    """
    _check_fidelity(options.fidelity)
    if isinstance(model, System):
        system = model
    else:
        system = load(model, vocabulary(), scenario, allocation, overrides)
    if has_cpp(system) and not options.graph:
        return _supervised(system, options)
    return _simulated(system, options)


def _simulated(system: System, options: Options) -> Run:
    """In this process."""
    simulation = _OnGraph(system, options) if options.graph else _Simulation(system, options, options.pace)
    try:
        simulation.prepare()
        return simulation.run()
    finally:
        simulation.leave()


def _supervised(system: System, options: Options) -> Run:
    """In a process of its own: C++ components may end it."""
    traced = options.traces is not None
    ready = compile_all(system, system.instances, options.fidelity, options.tell, traced=traced)
    if not ready:
        return _simulated(system, options)
    libraries = {name: one.compiled.library for name, one in ready.items()}
    supervision = Supervision(build_framework(), libraries, PATIENCE_S)
    return run_supervised(
        lambda show: _simulated(system, replace(options, show=show, tell=None)),
        options.show,
        supervision,
        partial(recover_run, system, options.out, options.seed, options.fidelity),
    )


def _check_fidelity(fidelity: str) -> None:
    if fidelity in LATER:
        raise CapabilityError(f"fidelity {fidelity!r} is not there yet; there is {choices(FIDELITIES)}")
    if fidelity not in FIDELITIES:
        raise UsageError(f"no fidelity {fidelity!r}; there is {choices((*FIDELITIES, *LATER))}")


class _Simulation:
    """One execution of ``simulate``, with everything in this process."""

    def __init__(self, system: System, options: Options, pace: float | None = None) -> None:
        self._system = system
        self._options = options
        self._kernel = VirtualKernel(pace=pace, watchdog_s=PATIENCE_S)
        self._ending = Ending(self._kernel)

    def _platform(self) -> Platform:
        options = self._options
        platform = Platform(self._system, self._kernel, options.seed, options.fidelity)
        platform.foresee()
        return platform

    def _setup(self, platform: Platform) -> RunSetup:
        return setup_of(self._system, platform, self._options.seed, self._options.fidelity)

    def _build(self, platform: Platform) -> BuiltComponents:
        builder = Builder(self._system, self._kernel, platform, self._fleet, self._ending)
        return builder.build(self._options.fidelity, self._options.seed, self._options.traces)

    def prepare(self) -> None:
        """Make what the run is made of. Raises what is wrong with the model."""
        system, kernel, options = self._system, self._kernel, self._options
        platform = self._platform()
        setup = self._setup(platform)
        surroundings = system.environment
        self._fleet = SimulatedFleet(
            kernel,
            system.vehicles,
            surroundings.origin,
            surroundings.wind,
            options.seed,
            through_bytes=with_faulty_links(surroundings),
        )
        self._built = self._build(platform)
        self._recording = Recording(setup, options.out, attachments_of(system))
        kernel.record = self._recording.stream
        self._observers = Observers(system.requirements, setup)
        self._recording.stream.tap(self._observers)
        if system.limits.until is not None:
            self._goal = Observers((system.limits.until,), setup)
            self._recording.stream.tap(self._goal)
            kernel.every(GOAL_PERIOD, self._look_at_goal)
        if options.show is not None:
            reporter = ProgressReporter(kernel, system.limits.duration_ns, self._fleet.progress, options.show)
            self._recording.stream.tap(reporter)
        self._feed = PowerFeed(kernel, platform, self._fleet)
        self._fleet.sample()
        affected = Affected(
            kernel,
            self._fleet,
            FleetLinks(self._fleet),
            surroundings.wind,
            platform.processors,
            platform.networks,
        )
        inject(surroundings.faults, affected)

    def _look_at_goal(self) -> None:
        if self._goal.all_hold(self._kernel.now()):
            self._ending.begin("completed", "its goal is reached")

    def run(self) -> Run:
        """Start, let time pass, end in order, close the books; also if the house itself has a fault."""
        kernel, ending = self._kernel, self._ending
        kernel.call_at(self._system.limits.duration_ns, lambda: ending.begin("completed", "its time is up"))
        try:
            with ending.signals():
                self._start()
                left = ending.pass_time()
        except BaseException as fault:
            ending.stop_hard("failed", f"{type(fault).__name__}: {fault}")
            self._close(())
            raise
        return self._close([*left, *self.leave()])

    def _start(self) -> None:
        self._built.start()

    def leave(self) -> list[str]:
        """Leave nothing behind; returns the names of those that would not go."""
        return []

    def _close(self, left: Sequence[str]) -> Run:
        now, ending = self._kernel.now(), self._ending
        self._built.finish()
        self._fleet.record_states()
        for warning in self._built.warnings():
            self._recording.stream(Text(now, WHO, WARNING, warning))
        verdicts = self._observers.verdicts(now)
        record = self._recording.finish(ending.status, ending.reason, now, verdicts)
        return Run(
            record,
            self._recording.folder,
            ending.error,
            tuple(left),
            tuple(self._recording.problems),
            tuple(self._recording.notes),
        )


class _OnGraph(_Simulation):
    """One execution of ``simulate`` on a real graph; see ``volery.run.distributed``."""

    def __init__(self, system: System, options: Options) -> None:
        pace = options.pace or 1.0
        system, self._unjudged = without_computers(system)
        super().__init__(system, options, pace)
        self._apart = DistributedRun(
            system, self._kernel, self._ending, GraphSettings(options.graph, pace, options.seed)
        )

    def _platform(self) -> Platform:
        host = HostPlatform(self._system, self._kernel, self._options.seed, self._options.fidelity)
        for name in self._unjudged:
            host.warnings[f"the requirement {name!r} is not judged: {NOT_MODELLED}"] = None
        return host

    def _setup(self, platform: Platform) -> RunSetup:
        return setup_of(unallocated(self._system), platform, self._options.seed, self._options.fidelity)

    def _build(self, platform: Platform) -> BuiltComponents:
        return self._apart.build(platform, self._fleet)

    def _start(self) -> None:
        self._apart.start()
        super()._start()
        self._apart.go()

    def leave(self) -> list[str]:
        """See ``_Simulation.leave``."""
        return self._apart.close()
