"""Campaigns: many runs of a model, recorded as they end, resumed where they were interrupted.

The coordinator asks the store for runs, hands them to an engine a few at a time, and writes each row when it
arrives. What was asked for has a number, and what has a row is never run again: so a campaign that was killed
goes on by asking for the same. A search asks for points that depend on earlier rows; it is resumed by asking
again, too, since rows that exist are returned and not made.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Final, Self

from volery.base.data_frames import to_frame
from volery.base.errors import ModelError, UsageError, VoleryError
from volery.base.installed import MissingExtraError, require_extra
from volery.base.time import S
from volery.explore.campaign_store import CampaignStore
from volery.explore.executors import EngineLostError, open_executor
from volery.explore.flight_phases import Phases, flight_phases
from volery.explore.parquet_table import write_parquet
from volery.explore.points import CampaignRow, Value, VariantPoint
from volery.explore.run_process import (
    CampaignSetting,
    PlannedRun,
    execute,
    installed_version,
    model_digest,
    read_variant,
)
from volery.explore.space import Choices, Parameter, default_space
from volery.explore.specification import Specification, read_specification, run_seed, specification_of
from volery.explore.statistics import Interval, Until
from volery.model import rules
from volery.model.builder import ModelBuilder
from volery.model.text import CollectedModelError
from volery.trace.events import Operation, VehicleState
from volery.trace.mcap_writer import TRACE_FILE
from volery.trace.reader import OpenTrace

TABLE_FILE: Final = "rows.parquet"
UNDISTURBED: Final = "undisturbed"
"""Run folder of the run without faults."""
AHEAD: Final = 2
"""Runs that are handed to an engine for each that it makes at a time, so that no worker waits."""
CHECKED: Final = 100
"""Values of each parameter that are read before the first run."""
WRONG_ALWAYS: Final = {one.code for one in (rules.BAD_CHANGE, rules.WRONG_VALUE, rules.WRONG_QUANTITY)}
"""What is wrong with a value whatever the others are; all else is found by the runs that it is wrong in."""
LATEST_S: Final = 1.0
"""Wall seconds between two reports of progress."""


@dataclass(frozen=True)
class CampaignProgress:
    """State of a campaign: ``left_s`` are the wall seconds to its end, None while they are unknown."""

    finished: int
    asked: int
    statuses: Mapping[str, int]
    left_s: float | None


ShowProgress = Callable[[CampaignProgress], None]


class Campaign:
    """A campaign in its folder. ``volery.explore`` makes one; this opens it again, to read or to go on.

    Example::

        with volery.Campaign("runs/frequencies") as campaign:
            print(campaign.table().groupby("set.allocation")["drone_1.energy"].mean())

    Args:
        folder: Folder of the campaign.
        model: The model, needed for further runs only if it was built in Python.
        on: Engine of further runs, such as ``processes`` or ``dask://127.0.0.1:8786``.
        workers: Runs at a time; 0 for as many as the engine has processors.
        show: Receives the progress of further runs about once a second.

    Raises:
        UsageError: The folder holds no campaign.
    """

    def __init__(
        self,
        folder: str | Path,
        *,
        model: ModelBuilder | None = None,
        on: str = "processes",
        workers: int = 0,
        show: ShowProgress | None = None,
    ) -> None:
        self.folder = Path(folder)
        self._model, self._on, self._workers, self._show = model, on, workers, show
        self._engine: tuple[Executor, int] | None = None
        self._store = CampaignStore(self.folder)
        self.stated = self._store.specification()

    def __enter__(self) -> Self:
        """Return the campaign; ``close`` follows."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the files."""
        self.close()

    def close(self) -> None:
        """Close the files and leave the engine."""
        self.leave_engine()
        self._store.close()

    def leave_engine(self) -> None:
        """End the processes of the engine, or leave the cluster. The next run opens it again."""
        engine, self._engine = self._engine, None
        if engine is not None:
            engine[0].shutdown(wait=sys.exc_info()[0] is None, cancel_futures=True)

    # -- reading

    @property
    def specification(self) -> Specification:
        """What the campaign runs."""
        return read_specification(self.stated["explore"])

    @property
    def setting(self) -> CampaignSetting:
        """What all its runs share."""
        stated, specification = self.stated, self.specification
        model: str | ModelBuilder | None = stated["model"] or self._model
        if model is None:
            raise UsageError(f"{self.folder}: its model was built in Python; give it as `model`")
        return CampaignSetting(
            model,
            specification.fidelity,
            specification.limit_ns / S,
            (specification.memory_b or 0.0) / 1e6,
            stated["version"],
            stated["digest"],
        )

    def count(self) -> tuple[int, int]:
        """Return how many runs were asked for, and how many of them are finished."""
        return self._store.count()

    def statuses(self) -> Mapping[str, int]:
        """Return how many finished runs have each status."""
        return self._store.statuses()

    def rows(self) -> Iterator[CampaignRow]:
        """Yield the finished rows in the order of their numbers; they are not held in memory."""
        return self._store.rows()

    def row(self, run: int) -> CampaignRow:
        """Return the row of a run. Raises ``UsageError`` if there is none."""
        found = self._store.row(run)
        if found is None:
            asked, _ = self.count()
            numbers = f"0 to {asked - 1}" if asked else "none yet"
            raise UsageError(f"{self.folder} has no run {run}; its runs are {numbers}")
        return found

    def table(self) -> Any:
        """Return the finished rows as a ``pandas.DataFrame`` with the index ``run``.

        Columns: ``seed``, the values of the points by their paths with ``set.`` before them, ``status``,
        ``reason``, the verdicts by requirement with ``met.`` before it, the observables by their names,
        ``sim_s``, and what differs from machine to machine: ``wall_s``, ``cpu_s``, ``host``, ``attempt``.
        """
        return to_frame(self._store.columns(self._store.kinds()), "run")

    def export(self) -> Path:
        """Write the table as Parquet into the folder, in parts that need little memory; return the file."""
        require_extra("explore", "a table in Parquet")
        path = self.folder / TABLE_FILE
        write_parquet(self._store, path)
        return path

    # -- running

    def evaluate(self, points: Sequence[VariantPoint]) -> list[CampaignRow]:
        """Run points and return their rows, in the order of *points*; rows that exist are not made again.

        The engine stays open for more of them until ``close``.

        Raises:
            UsageError: The model or volery is not the one that the campaign began with, another process
                writes the campaign, or the engine is not there.
            EngineLostError: The engine was lost. The campaign can be resumed, as after any other end.
        """
        self.run(points)
        found = [self._store.find(point) for point in points]
        return [row for row in found if row is not None]

    def run(self, points: Iterable[VariantPoint]) -> None:
        """Run points that have no row yet. For many of them: none is held. Raises as ``evaluate``."""
        self._check_unchanged()
        self._store.close()
        self._store = CampaignStore(self.folder, write=True)
        try:
            self._store.ask(points)
            asked, finished = self.count()
            if asked > finished:
                self._run_unfinished()
        finally:
            self._store.close()  # others may write now
            self._store = CampaignStore(self.folder)

    def run_until(self, until: Until) -> dict[str, Interval]:
        """Run each variant until an interval is narrow enough, or until its seeds are used up.

        Example::

            request = CampaignRequest.of("model.yaml", "runs/sure", seeds=1000)
            prepare(request).run_until(read_until("landing within 5 %"))

        Args:
            until: What is to be known how well, by ``statistics.read_until``.

        Returns:
            The interval of each variant, by ``VariantPoint.variant``.

        Raises:
            UsageError: As of ``evaluate``, or no run judges such a requirement.
        """
        found: dict[str, Interval] = {}
        for variant, grouped in groupby(self.specification.run_points(), lambda one: one.variant):
            points = list(grouped)

            def interval_after(runs: int, points: list[VariantPoint] = points) -> Interval:
                return until.interval(self.evaluate(points[:runs]))

            found[variant] = until.enough(interval_after, len(points))
        return found

    def show(self, run: int, out: str | Path) -> Any:
        """Make a run again, with trace and report, and return its ``volery.Run``.

        Args:
            run: Number of the run.
            out: Run folder.

        Raises:
            UsageError: There is no such run, or model or volery have changed since.
        """
        from volery.run.result import Options  # noqa: PLC0415  # reading a campaign needs no simulation
        from volery.run.simulate import simulate  # noqa: PLC0415

        row = self.row(run)
        self._check_unchanged()
        system = read_variant(self.setting.model, row.point.values)
        return simulate(system, Options(fidelity=self.setting.fidelity, seed=row.point.seed, out=Path(out)))

    def flight_phases(self) -> Phases:
        """Return when each vehicle goes through which phase in a run of the model as it is.

        The run is made with the first seed of the campaign, and kept in the folder ``undisturbed``.

        Raises:
            UsageError: The run did not come to its regular end, or no vehicle moved.
        """
        from volery.run.result import Options  # noqa: PLC0415  # reading a campaign needs no simulation
        from volery.run.simulate import simulate  # noqa: PLC0415

        folder = self.folder / UNDISTURBED
        system = read_variant(self.setting.model, {})
        seed = run_seed(self.specification.seed, 0)
        run = simulate(system, Options(fidelity=self.setting.fidelity, seed=seed, out=folder))
        if not run.completed:
            raise UsageError(f"{folder}: the run without faults did not come to its regular end: {run.error}")
        with OpenTrace(folder / TRACE_FILE) as reading:
            rovers = {vehicle.name for vehicle in system.vehicles if vehicle.kind == "rover"}
            phases = flight_phases(reading.events([VehicleState, Operation]), rovers)
        if not phases:
            raise UsageError(f"{folder}: no vehicle was armed, so there is no phase in which to try faults")
        return phases

    def _check_unchanged(self) -> None:
        """Raise ``UsageError`` if the rows that exist would be different today."""
        stated = self.stated
        if stated["version"] != installed_version():
            raise UsageError(
                f"{self.folder} was made by volery {stated['version']}, and this is {installed_version()}: "
                "its rows and new ones could not be compared; install that version, or use a new folder"
            )
        if stated["digest"] != model_digest(read_variant(self.setting.model, {})):
            raise UsageError(
                f"the model of {self.folder}, {stated['model'] or 'built in Python'}, has changed since: its "
                "rows and new ones could not be compared; restore its files, or use a new folder"
            )

    def _run_unfinished(self) -> None:
        if self._engine is None:
            self._engine = open_executor(self._on, self._workers)
        executor, workers = self._engine
        waiting = 0
        done: SimpleQueue[Future[CampaignRow]] = SimpleQueue()  # `wait` would look at all that wait
        unfinished = self._store.unfinished()
        progress = _ProgressClock(self._store, self._show)
        finished: list[CampaignRow] = []
        setting = self.setting
        try:
            while True:
                started = []
                while waiting < AHEAD * workers and (task := _next_task(unfinished, setting)) is not None:
                    executor.submit(execute, task).add_done_callback(done.put)
                    waiting += 1
                    started.append(task.run)
                self._store.record(finished, started)
                progress.add(finished)
                if not waiting:
                    return
                finished = []
                with suppress(Empty):
                    one = done.get(timeout=LATEST_S)
                    while True:
                        waiting -= 1
                        finished.append(self._result(one, finished))
                        one = done.get_nowait()
        except BaseException:
            self.leave_engine()
            raise

    def _result(self, done: Future[CampaignRow], finished: Sequence[CampaignRow]) -> CampaignRow:
        """Return the row of a finished run. If the engine failed, keep the other rows first."""
        try:
            return done.result()
        except Exception as error:
            with suppress(VoleryError):  # the first error is the one to report
                self._store.record(finished)
            if isinstance(error, VoleryError) and not isinstance(error, EngineLostError):
                raise
            asked, done_before = self.count()
            reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__  # dask's has lines
            raise EngineLostError(
                f"the engine {self._on} was lost after {done_before} of {asked} runs: {reason}; "
                "the same command resumes the campaign"
            ) from error


def _next_task(
    unfinished: Iterator[tuple[int, int, VariantPoint]], setting: CampaignSetting
) -> PlannedRun | None:
    found = next(unfinished, None)
    if found is None:
        return None
    run, attempts, point = found
    return PlannedRun(setting, run, point, attempts + 1)


class _ProgressClock:
    """Reports the progress of a campaign about once a second."""

    def __init__(self, store: CampaignStore, show: ShowProgress | None) -> None:
        self._show = show
        self._asked, self._finished = store.count()
        self._before = self._finished
        self._statuses = store.statuses()
        self._began = self._last = time.monotonic()

    def add(self, rows: Sequence[CampaignRow]) -> None:
        """Count finished rows, and report if it is time."""
        for row in rows:
            self._finished += 1
            self._statuses[row.status] = self._statuses.get(row.status, 0) + 1
        now = time.monotonic()
        over = self._finished == self._asked
        if self._show is None or (now - self._last < LATEST_S and not over):
            return
        self._last = now
        made = self._finished - self._before
        left = (self._asked - self._finished) * (now - self._began) / made if made else None
        self._show(CampaignProgress(self._finished, self._asked, dict(self._statuses), left))


@dataclass(frozen=True)
class CampaignRequest:
    """What ``explore`` and ``prepare`` are asked for.

    Attributes:
        model: A file, a folder with a ``model.yaml``, or a ``ModelBuilder``.
        out: Folder of the campaign.
        specification: What is run. One without parameters varies the model's own ``design_parameters``.
        on: The engine: ``processes`` on this machine, ``dask://HOST:PORT`` or ``ray://HOST:PORT``.
        workers: Runs at a time; 0 for as many as the engine has processors.
        show: Receives the progress about once a second.
    """

    model: str | Path | ModelBuilder
    out: str | Path
    specification: Specification
    on: str = "processes"
    workers: int = 0
    show: ShowProgress | None = None

    @classmethod
    def of(
        cls,
        model: str | Path | ModelBuilder,
        out: str | Path,
        space: Mapping[str, Parameter | Sequence[Value]] | None = None,
        specification: Specification | None = None,
        **stated: Any,
    ) -> Self:
        """Return a request for a specification with changes.

        Args:
            model: The model.
            out: Folder of the campaign.
            space: Parameters, or lists of values, by the paths that they set and by ``scenario`` and
                ``allocation``. They are added to those of the specification.
            specification: By default what the model says under ``explore``, or ``explore.yaml`` beside it.
            stated: Further attributes, and fields of ``Specification``: ``seeds=20``.

        Raises:
            ModelError: What the model says is wrong.
            UsageError: There is no such attribute or field.
        """
        own = {name: stated.pop(name) for name in ("on", "workers", "show") if name in stated}
        unknown = [name for name in stated if name not in Specification.__dataclass_fields__]
        if unknown:
            raise UsageError(f"explore() has no argument {unknown[0]!r}")
        made = specification or specification_of(model)
        added = {
            path: one if isinstance(one, Parameter) else Choices(one) for path, one in (space or {}).items()
        }
        return cls(model, out, replace(made, space={**made.space, **added}, **stated), **own)


def explore(request: CampaignRequest) -> Campaign:
    """Run a campaign, or resume the one in its folder, and return it.

    ``volery.explore`` makes the request from its arguments, which are those of ``CampaignRequest.of``.

    Example::

        campaign = volery.explore(
            "model.yaml",
            "runs/frequencies",
            {"platform.processors.onboard.frequency": ["600 MHz", "1500 MHz"]},
            seeds=20,
        )
        print(campaign.table())

    Raises:
        ModelError: The model or its specification is wrong, or has no such path; nothing has started.
        UsageError: An option is wrong, or the folder holds another campaign.
        EngineLostError: The engine was lost. Calling again resumes the campaign.
    """
    campaign = prepare(request)
    campaign.run(campaign.specification.run_points())
    campaign.leave_engine()
    with suppress(MissingExtraError):
        campaign.export()
    return campaign


def prepare(request: CampaignRequest) -> Campaign:
    """Return the campaign that ``explore`` would run, not begun. Errors as of ``explore``."""
    model, made = request.model, request.specification
    system = read_variant(model if isinstance(model, ModelBuilder) else str(model), {})
    made = replace(made, space=made.space or default_space(system))
    made = read_specification(made.plain())  # what Python states is checked as what YAML states
    _check_paths(model, made)
    path = None if isinstance(model, ModelBuilder) else str(Path(model).resolve())
    begun = {
        "model": path,
        "digest": model_digest(system),
        "version": installed_version(),
        "explore": made.plain(),
    }
    folder = Path(request.out)
    store = CampaignStore(folder, write=True)
    try:
        known = store.specification()
        for key, what in (
            ("model", "model"),
            ("version", "volery"),
            ("digest", "state of the model"),
        ):
            if known and known[key] != begun[key]:
                raise UsageError(
                    f"{folder} holds a campaign of another {what}, {known[key]} and not {begun[key]}: its "
                    "rows and new ones could not be compared; use a new folder"
                )
        if known and known["explore"]["fidelity"] != made.fidelity:
            raise UsageError(
                f"{folder} holds a campaign at fidelity {known['explore']['fidelity']}; use a new folder"
            )
        store.write_specification(begun)
    finally:
        store.close()
    built = model if isinstance(model, ModelBuilder) else None
    return Campaign(folder, model=built, on=request.on, workers=request.workers, show=request.show)


def _check_paths(model: str | Path | ModelBuilder, specification: Specification) -> None:
    """Raise what is wrong with the paths, names and texts of a space: it would be wrong in every run."""
    source = model if isinstance(model, ModelBuilder) else str(model)
    for path, parameter in specification.space.items():
        values = parameter.values if isinstance(parameter, Choices) else [parameter.at(0.5)]
        for value in values[:CHECKED]:
            try:
                read_variant(source, {path: value})
            except ModelError as error:
                errors = error.errors if isinstance(error, CollectedModelError) else [error]
                wrong = [error for error in errors if error.code in WRONG_ALWAYS]
                if wrong:
                    raise wrong[0] from None
