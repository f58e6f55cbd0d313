"""A run of a model in virtual time as an object: watch it, step it, pause it, stop it."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread, current_thread
from typing import Any

from volery.base.errors import CapabilityError, UsageError, choices
from volery.base.time import MS, Ns, S
from volery.kernel.virtual import VirtualKernel
from volery.model.builder import ModelBuilder
from volery.model.system import System
from volery.model.system_loader import load
from volery.requirements.verdicts import Observers
from volery.ros.graph.graph_context import Recorded
from volery.run.assembly.component_builder import Builder, BuiltComponents, with_executables
from volery.run.assembly.computers import ComputingPlatform, PowerFeed
from volery.run.assembly.fault_effects import Affected, FleetLinks, inject, with_faulty_links
from volery.run.assembly.firmware_programs import ProgramFolder, on_real_firmware
from volery.run.assembly.model_checks import vocabulary
from volery.run.assembly.place_services import serve_batteries, serve_loads
from volery.run.assembly.simulated_fleet import OutsideAutopilot, SimulatedFleet, surroundings_of
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
from volery.run.result import (
    DEFAULT_OPTIONS,
    FULL,
    ComponentLogReporter,
    Options,
    ProgressReporter,
    Run,
    VehicleProgress,
)
from volery.run.trace_setup import attachments_of, setup_of
from volery.trace.attachments import RunSetup
from volery.trace.events import Record, Text, ignore

WHO, WARNING = "volery", 4
"""Source and severity of the warnings of a run."""

NOT_MODELLED = "its components compute on this machine and not on the model's processors"

NO_TRUTH = "its components are started by others, which cannot see the true state of vehicles"

PATIENCE_S = 30.0
"""Wall seconds that a component may compute without letting virtual time pass."""

TIMES, CODE, FIRMWARE = FIDELITIES = ("times", "code", "firmware")
LATER = ("hardware",)

NO_LIMIT: Ns = 0
"""Duration of a run that goes on until something ends it; no model states it."""

GOAL_PERIOD: Ns = 100 * MS
"""Period at which the model's ``until`` is checked."""


def check_fidelity(fidelity: str) -> None:
    """Raise ``CapabilityError`` or ``UsageError`` for a fidelity that a run cannot have."""
    if fidelity in LATER:
        raise CapabilityError(f"fidelity {fidelity!r} is not there yet; there is {choices(FIDELITIES)}")
    if fidelity not in FIDELITIES:
        raise UsageError(f"no fidelity {fidelity!r}; there is {choices((*FIDELITIES, *LATER))}")


def check_step(duration: Ns) -> None:
    """Raise ``UsageError`` if virtual time cannot pass for *duration*."""
    if not isinstance(duration, int) or duration <= 0:
        raise UsageError(f"a step of {duration} ns; give a whole number above 0")


def read_system(
    model: System | ModelBuilder | str | Path,
    scenario: str | None = None,
    allocation: str | None = None,
    overrides: Iterable[str] = (),
) -> System:
    """Return a model with the files of its components. Arguments and errors as of ``simulate``."""
    if not isinstance(model, System):
        model = load(model, vocabulary(), scenario, allocation, overrides)
    return with_executables(model)


def _on_real_firmware(system: System) -> tuple[System, tuple[str, ...]]:
    """Return a model whose vehicles fly on real firmware, and why some do not."""
    vehicles = on_real_firmware(system.vehicles)
    remarks = tuple(
        f"{vehicle.name} flies on the simulated {vehicle.autopilot}: "
        "no real firmware of it flies in virtual time"
        for vehicle in vehicles
        if vehicle.firmware is None
    )
    return replace(system, environment=replace(system.environment, vehicles=vehicles)), remarks


class RunSession:
    """One run of a model in virtual time, in this process, that can be watched, stepped, paused and stopped.

    ``simulate`` is a session that runs to its end. The trace is the same however a session is stepped.

    Args:
        model: As of ``simulate``, and so are the other arguments.
        options: Options of the run.
        scenario: Scenario of a model that is read from a file.
        allocation: Allocation of a model that is read from a file; None for its first.
        overrides: Changes ``path=value`` of a model that is read from a file.

    Raises:
        ModelError: The model is wrong; nothing has started.
        UsageError: An option is wrong; nothing has started.

    Example::

        session = volery.RunSession("model.yaml")
        session.tap(print, Collision)
        while session.step(S):
            show(session.progress())
        print(session.result.ok)
    """

    def __init__(
        self,
        model: System | ModelBuilder | str | Path,
        options: Options = DEFAULT_OPTIONS,
        *,
        scenario: str | None = None,
        allocation: str | None = None,
        overrides: Iterable[str] = (),
    ) -> None:
        check_fidelity(options.fidelity)
        self._system = read_system(model, scenario, allocation, overrides)
        self._simulated: tuple[str, ...] = ()
        if options.fidelity == FIRMWARE:
            self._system, self._simulated = _on_real_firmware(self._system)
        self._options = options
        self._kernel = VirtualKernel(pace=options.pace, watchdog_s=PATIENCE_S)
        self._ending = Ending(self._kernel)
        self._unpublished = set(options.record_topics)
        self._result: Run | None = None
        self._thread: Thread | None = None
        self._goes_on = Event()
        self._goes_on.set()
        self._opened = ExitStack()
        try:
            self._prepare()
        except BaseException:
            self.leave()
            raise

    # -- watching

    @property
    def now(self) -> Ns:
        """Virtual time, ns."""
        return self._kernel.now()

    @property
    def running(self) -> bool:
        """Whether the run has not ended; it may not have begun."""
        return self._result is None

    @property
    def result(self) -> Run:
        """The run, once it has ended. Raises ``UsageError`` before."""
        if self._result is None:
            raise UsageError("the run has not ended: step until step() is False, or call run() or stop()")
        return self._result

    def progress(self) -> tuple[VehicleProgress, ...]:
        """Return the present state of each vehicle."""
        return self._fleet.progress()

    def tap(self, listener: Record, *kinds: type[Any]) -> None:
        """Call *listener* with each event of some kinds (of ``volery.trace.events``) as it is recorded.

        Without *kinds* it gets every event. It must not block, and what it raises ends the run.
        """
        self._recording.stream.tap_guarded(_Chosen(listener, kinds) if kinds else listener, _raise)

    # -- steering

    @property
    def pace(self) -> float | None:
        """Simulated seconds per wall second; ``None``: as fast as possible. It may be set between steps."""
        return self._kernel.pace

    @pace.setter
    def pace(self, pace: float | None) -> None:
        self._kernel.pace = pace

    def step(self, duration: Ns) -> bool:
        """Let virtual time pass, at most *duration* ns; return whether the run goes on after it.

        Raises:
            UsageError: *duration* is not a whole number above 0, or another thread began the run.
        """
        check_step(duration)
        if self._result is not None:
            return False
        self._check_thread()
        with self._ending.signals():  # a closed terminal does not end the writing of the record either
            try:
                self._begin()
                goes_on = self._ending.advance(self._kernel.now() + duration)
                if goes_on:
                    return True
                left = self._kernel.close(self._ending.reason)
            except BaseException as fault:
                self._ending.stop_hard("failed", f"{type(fault).__name__}: {fault}")
                self._close(self.leave())
                raise
            self._close([*left, *self.leave()])
            return False

    def run(self) -> Run:
        """Let time pass to the end of the run and return it. ``pause`` holds it, from another thread."""
        gc.freeze()  # what exists now stays until the end: collections need not look at it
        try:
            while self.step(self._slice()):
                self._goes_on.wait()
        finally:
            gc.unfreeze()
        return self.result

    def pause(self) -> None:
        """Hold ``run``, from another thread: virtual time stands still until ``resume``."""
        self._goes_on.clear()

    def resume(self) -> None:
        """Let a held ``run`` go on."""
        self._goes_on.set()

    def stop(self, reason: str = "stopped") -> Run:
        """End the run in order: components are cancelled, vehicles brought to rest. Return the run.

        Raises:
            UsageError: Another thread began the run.
        """
        if self._result is None:
            self._check_thread()
        self._goes_on.set()
        if self._result is None:
            self._begin_end(reason)
        return self.run()

    def _begin_end(self, reason: str) -> None:
        """Let the run end in order as its time passes."""
        self._begin()
        self._ending.begin("interrupted", reason)

    def _slice(self) -> Ns:
        """Return how much time passes between two looks at ``pause``: a tenth of a second on the wall."""
        return S if self.pace is None else max(1, round(self.pace * 100 * MS))

    # -- parts

    def _platform(self) -> ComputingPlatform:
        options = self._options
        platform = ComputingPlatform(self._system, self._kernel, options.seed, options.fidelity)
        platform.look_up_prices()
        return platform

    def _setup(self, platform: ComputingPlatform) -> RunSetup:
        return setup_of(self._system, platform, self._options.seed, self._options.fidelity)

    def _build(self, platform: ComputingPlatform) -> BuiltComponents:
        options = self._options
        builder = Builder(
            self._system, self._kernel, platform, self._fleet, self._ending, records=self._recorded
        )
        return builder.build(options.fidelity, options.seed, options.traces)

    def _outside(self) -> Mapping[str, OutsideAutopilot]:
        """Return the autopilots that others bring, by vehicle."""
        return {}

    def _recorded(self, topic: str) -> Recorded:
        """Return what is recorded of a topic when a node publishes it."""
        self._unpublished.discard(topic)
        if self._options.record == FULL or topic in self._options.record_topics:
            return Recorded.ALL
        return Recorded.SHORT if self._options.traced else Recorded.NOTHING

    def _prepare(self) -> None:
        """Create all parts of the run."""
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
            programs=ProgramFolder(options.folder, options.tell),
            outside=self._outside(),
        )
        self._opened.callback(self._fleet.close)
        self._fleet.on_collision = self._ending.vehicle_hit
        self._built = self._build(platform)
        self._recording = Recording(setup, options.folder, attachments_of(system), traced=options.traced)
        kernel.record = self._recording.stream
        self._observers = Observers(system.requirements, setup)
        self._recording.stream.tap(self._observers)
        if options.log is not None:
            self._recording.log_into(options.log)
        self._log = ComponentLogReporter([instance.name for instance in system.instances], options.tell)
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
        serve_batteries(kernel, self._fleet, environment.places.values())
        serve_loads(kernel, self._fleet, environment.loads)
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

    def _begin(self) -> None:
        """Start everything, once."""
        if self._thread is not None:
            return
        self._thread = current_thread()
        ending = self._ending
        duration = self._system.limits.duration_ns
        if duration != NO_LIMIT:
            self._kernel.call_at(duration, lambda: ending.begin("completed", "its time is up"))
        self._start()

    def _check_thread(self) -> None:
        if self._thread not in (None, current_thread()):  # tasks cannot move to another thread
            raise UsageError("another thread began this run: step, run and stop it there; pause() is for all")

    def _start(self) -> None:
        self._built.start()

    def leave(self) -> list[str]:
        """End the autopilots and leave the graph, if any. Return the names of components that were killed."""
        self._opened.close()
        return []

    def _close(self, left: Sequence[str]) -> None:
        now, ending = self._kernel.now(), self._ending
        self._built.finish()
        self._fleet.record_states()
        unpublished = (f"record {one}: no node published this topic" for one in sorted(self._unpublished))
        remarks = (*self._fleet.remarks(), *self._simulated)
        for warning in (*self._built.warnings(), *self._log.finish(), *unpublished, *remarks):
            self._recording.stream(Text(now, WHO, WARNING, warning))
        for one in self._built.unserved():
            self._recording.stream(one)
        verdicts = self._observers.verdicts(now)
        record = self._recording.finish(ending.status, ending.reason, now, verdicts)
        self._result = Run(
            record,
            self._recording.folder,
            ending.error,
            tuple(left),
            tuple(self._recording.problems),
            tuple(self._recording.notes),
            self._recording.accounts.observables(now),
        )


class GraphSession(RunSession):
    """A run on a real graph; see ``volery.run.distributed``."""

    _distributed: DistributedRun | None = None

    def __init__(self, system: System, options: Options) -> None:
        if options.record_topics:
            what = "on a real graph the content of every message is recorded"
            raise UsageError(f"record {options.record}: {what}; leave it out")
        options = replace(options, pace=options.pace or 1.0)
        system, unjudged = without_computers(system)
        self._unjudged = dict.fromkeys(unjudged, NOT_MODELLED)
        if options.deployed:
            system, unjudged = without_truth(system)
            self._unjudged |= dict.fromkeys(unjudged, NO_TRUTH)
        super().__init__(system, options)

    def _platform(self) -> ComputingPlatform:
        host = HostPlatform(self._system, self._kernel, self._options.seed, self._options.fidelity)
        for name, why in self._unjudged.items():
            host.warnings[f"the requirement {name!r} is not judged: {why}"] = None
        return host

    def _setup(self, platform: ComputingPlatform) -> RunSetup:
        return setup_of(unallocated(self._system), platform, self._options.seed, self._options.fidelity)

    def _build(self, platform: ComputingPlatform) -> BuiltComponents:
        options = self._options
        assert options.pace is not None, "set above"
        self._distributed = DistributedRun(
            self._system,
            self._kernel,
            self._ending,
            GraphSettings(options.graph, options.pace, options.seed, options.deployed),
        )
        return self._distributed.build(platform, self._fleet)

    def _start(self) -> None:
        assert self._distributed is not None, "prepared"
        self._distributed.start()
        super()._start()
        self._distributed.go()

    def leave(self) -> list[str]:
        """See ``RunSession``."""
        left = [] if self._distributed is None else self._distributed.close()
        return [*left, *super().leave()]


def _raise(error: Exception) -> None:
    raise error


class _Chosen:
    """A tap that selects kinds of events, so that the others cost nothing."""

    def __init__(self, listener: Record, kinds: tuple[type[Any], ...]) -> None:
        self._listener, self._kinds = listener, kinds

    def listener(self, kind: type[Any]) -> Record:
        """Return what takes events of a kind."""
        return self._listener if kind in self._kinds else ignore

    def __call__(self, event: Any) -> None:
        """Take an event."""
        self.listener(type(event))(event)
