"""``simulate``: a model in virtual time."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from volery.base.errors import CapabilityError, UsageError, choices
from volery.base.garbage import seldom_collected
from volery.base.time import MS, Ns
from volery.components.cpp.build import build_framework
from volery.kernel.virtual import VirtualKernel
from volery.model.builder import ModelBuilder
from volery.model.system import System
from volery.model.system_loader import load
from volery.requirements.verdicts import Observers
from volery.ros.graph.embedded_graph import record_all, record_none
from volery.run.assembly.component_builder import Builder, BuiltComponents, with_executables
from volery.run.assembly.computers import Platform, PowerFeed
from volery.run.assembly.cpp import compile_all, has_cpp
from volery.run.assembly.fault_effects import Affected, FleetLinks, inject, with_faulty_links
from volery.run.assembly.model_checks import vocabulary
from volery.run.assembly.simulated_fleet import SimulatedFleet, surroundings_of
from volery.run.distributed import (
    DistributedRun,
    GraphSettings,
    HostPlatform,
    unallocated,
    without_computers,
    without_truth,
)
from volery.run.ending import Ending
from volery.run.recording import Recording
from volery.run.result import DEFAULT_OPTIONS, ComponentLogReporter, Options, ProgressReporter, Run
from volery.run.supervision import Supervision, recover_run, run_supervised
from volery.run.trace_setup import attachments_of, setup_of
from volery.trace.attachments import RunSetup
from volery.trace.events import Text

FIDELITIES = ("times", "code")
LATER = ("firmware", "hardware")
WHO, WARNING = "volery", 4
"""Source and severity of the warnings of a run."""

NOT_MODELLED = "its components compute on this machine and not on the model's processors"

NO_TRUTH = "its components are started by others, which cannot see the true state of vehicles"

PATIENCE_S = 30.0
"""Wall seconds that a component may compute without letting virtual time pass."""

GOAL_PERIOD: Ns = 100 * MS
"""Period at which the model's ``until`` is checked."""


@seldom_collected()
def simulate(
    model: System | ModelBuilder | str | Path,
    options: Options = DEFAULT_OPTIONS,
    *,
    scenario: str | None = None,
    allocation: str | None = None,
    overrides: Iterable[str] = (),
) -> Run:
    """Simulate a model in virtual time and return its record.

    The same model, options and seed give the same trace, byte for byte.

    Args:
        model: A file, a folder with a ``model.yaml``, a ``ModelBuilder``, or a ``System``.
        options: Fidelity, seed, pace, run folder and progress reports.
        scenario: Scenario of a model that is read from a file.
        allocation: Allocation of a model that is read from a file; None for its first.
        overrides: Changes ``path=value`` of a model that is read from a file.

    Returns:
        The run. An error during the simulation is its ``error`` and is not raised.

    Raises:
        ModelError: The model is wrong; nothing has started.
        UsageError: An option is wrong; nothing has started.
    """
    _check_fidelity(options.fidelity)
    if isinstance(model, System):
        system = model
    else:
        system = load(model, vocabulary(), scenario, allocation, overrides)
    system = with_executables(system)
    if has_cpp(system) and not options.graph:
        return _supervised(system, options)
    return _simulated(system, options)


def _simulated(system: System, options: Options) -> Run:
    """Run in this process."""
    simulation = _OnGraph(system, options) if options.graph else _Simulation(system, options, options.pace)
    try:
        simulation.prepare()
        return simulation.run()
    finally:
        simulation.leave()


def _supervised(system: System, options: Options) -> Run:
    """Run in a child process, which a C++ component may crash."""
    traced = options.traces is not None
    ready = compile_all(system, system.instances, options.fidelity, options.tell, traced=traced)
    if not ready:
        return _simulated(system, options)
    libraries = {name: one.compiled.library for name, one in ready.items()}
    supervision = Supervision(build_framework(), libraries, PATIENCE_S)
    return run_supervised(
        lambda show, tell: _simulated(system, replace(options, show=show, tell=tell)),
        options.show,
        options.tell,
        supervision,
        partial(recover_run, system, options.folder, options.seed, options.fidelity),
    )


def _check_fidelity(fidelity: str) -> None:
    if fidelity in LATER:
        raise CapabilityError(f"fidelity {fidelity!r} is not there yet; there is {choices(FIDELITIES)}")
    if fidelity not in FIDELITIES:
        raise UsageError(f"no fidelity {fidelity!r}; there is {choices((*FIDELITIES, *LATER))}")


class _Simulation:
    """One execution of ``simulate`` with all components in this process."""

    def __init__(self, system: System, options: Options, pace: float | None = None) -> None:
        self._system = system
        self._options = options
        self._kernel = VirtualKernel(pace=pace, watchdog_s=PATIENCE_S)
        self._ending = Ending(self._kernel)

    def _platform(self) -> Platform:
        options = self._options
        platform = Platform(self._system, self._kernel, options.seed, options.fidelity)
        platform.look_up_prices()
        return platform

    def _setup(self, platform: Platform) -> RunSetup:
        return setup_of(self._system, platform, self._options.seed, self._options.fidelity)

    def _build(self, platform: Platform) -> BuiltComponents:
        records = record_all if self._options.traced else record_none
        builder = Builder(self._system, self._kernel, platform, self._fleet, self._ending, records=records)
        return builder.build(self._options.fidelity, self._options.seed, self._options.traces)

    def prepare(self) -> None:
        """Create all parts of the run. Raises what is wrong with the model."""
        system, kernel, options = self._system, self._kernel, self._options
        platform = self._platform()
        setup = self._setup(platform)
        environment = system.environment
        self._fleet = SimulatedFleet(
            kernel,
            system.vehicles,
            surroundings_of(environment),
            options.seed,
            through_bytes=with_faulty_links(environment),
        )
        self._fleet.on_collision = self._ending.vehicle_hit
        self._built = self._build(platform)
        self._recording = Recording(setup, options.folder, attachments_of(system), traced=options.traced)
        kernel.record = self._recording.stream
        self._observers = Observers(system.requirements, setup)
        self._recording.stream.tap(self._observers)
        if options.log is not None:
            self._recording.log_into(options.log)
        self._log = ComponentLogReporter([one.name for one in system.instances], options.tell)
        self._recording.stream.tap(self._log)
        if system.limits.until is not None:
            self._goal = Observers((system.limits.until,), setup)
            self._recording.stream.tap(self._goal)
            kernel.every(GOAL_PERIOD, self._check_goal)
        if options.show is not None:
            reporter = ProgressReporter(kernel, system.limits.duration_ns, self._fleet.progress, options.show)
            self._recording.stream.tap(reporter)
        self._feed = PowerFeed(kernel, platform, self._fleet)
        self._fleet.sample()
        affected = Affected(
            kernel,
            self._fleet,
            FleetLinks(self._fleet),
            environment.wind,
            platform.processors,
            platform.networks,
        )
        inject(environment.faults, affected)

    def _check_goal(self) -> None:
        if self._goal.all_hold(self._kernel.now()):
            self._ending.begin("completed", "its goal is reached")

    def run(self) -> Run:
        """Start, let time pass, end in order and finish the recording, even after an internal error."""
        kernel, ending = self._kernel, self._ending
        kernel.call_at(self._system.limits.duration_ns, lambda: ending.begin("completed", "its time is up"))
        with ending.signals():  # a terminal that is closed does not end the writing of the record either
            try:
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
        """Leave the graph, if any. Return the names of components that had to be killed."""
        return []

    def _close(self, left: Sequence[str]) -> Run:
        now, ending = self._kernel.now(), self._ending
        self._built.finish()
        self._fleet.record_states()
        for warning in (*self._built.warnings(), *self._log.finish()):
            self._recording.stream(Text(now, WHO, WARNING, warning))
        for one in self._built.unserved():
            self._recording.stream(one)
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
        system, unjudged = without_computers(system)
        self._unjudged = dict.fromkeys(unjudged, NOT_MODELLED)
        if options.deployed:
            system, unjudged = without_truth(system)
            self._unjudged |= dict.fromkeys(unjudged, NO_TRUTH)
        super().__init__(system, options, pace)
        self._distributed = DistributedRun(
            system,
            self._kernel,
            self._ending,
            GraphSettings(options.graph, pace, options.seed, options.deployed),
        )

    def _platform(self) -> Platform:
        host = HostPlatform(self._system, self._kernel, self._options.seed, self._options.fidelity)
        for name, why in self._unjudged.items():
            host.warnings[f"the requirement {name!r} is not judged: {why}"] = None
        return host

    def _setup(self, platform: Platform) -> RunSetup:
        return setup_of(unallocated(self._system), platform, self._options.seed, self._options.fidelity)

    def _build(self, platform: Platform) -> BuiltComponents:
        return self._distributed.build(platform, self._fleet)

    def _start(self) -> None:
        self._distributed.start()
        super()._start()
        self._distributed.go()

    def leave(self) -> list[str]:
        """See ``_Simulation.leave``."""
        return self._distributed.close()
