"""Engines that carry runs to computers: each is a ``concurrent.futures.Executor``.

A package adds one by an entry point of the group ``volery.executors``: a function of the address after
``NAME://`` and of the number of workers that was asked for (0: all there are). An engine carries, and does
nothing else: ``run_process.execute`` limits a run and makes its row, the coordinator stores it as soon as it
arrives. So an engine that repeats a task whose worker was lost gives the same row.
"""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from threading import current_thread, main_thread
from typing import Any, Final

from volery.base.errors import UsageError, VoleryError
from volery.base.installed import Registry, require_extra
from volery.explore.run_process import stop_processes

MakeExecutor = Callable[[str, int], Executor]

CONNECT_S: Final = 20.0
"""Wall seconds within which a scheduler must answer."""


class EngineLostError(VoleryError):
    """The scheduler or the cluster that carried the runs is gone."""


executors: Registry[MakeExecutor] = Registry("volery.executors", "engine")


def open_executor(on: str = "processes", workers: int = 0) -> tuple[Executor, int]:
    """Return an engine and how many runs it makes at a time.

    Args:
        on: Name of the engine, with the address of its cluster if it has one: ``dask://host:8786``.
        workers: Number of runs at a time; 0 for one on each processor.

    Raises:
        UsageError: There is no such engine, or its scheduler does not answer.
    """
    name, _, address = on.partition("://")
    if workers < 0:
        raise UsageError(f"{workers} workers; give 1 or more, or 0 for all")
    executor = executors.load(name)(address, workers)
    return executor, getattr(executor, "workers", 0) or workers or len(os.sched_getaffinity(0))


class ProcessExecutor(ThreadPoolExecutor):
    """Processes on this machine. Its threads wait for the processes of ``run_process``."""

    def __init__(self, address: str, workers: int) -> None:
        if address:
            raise UsageError(f"processes://{address}: processes are on this machine and have no address")
        self.workers = workers or len(os.sched_getaffinity(0))
        super().__init__(self.workers, "waits-for-run")

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; runs in progress are lost."""
        super().shutdown(wait=False, cancel_futures=cancel_futures)
        stop_processes()
        super().shutdown(wait=wait)


class DaskExecutor(Executor):
    """A cluster of Dask, by the address of its scheduler. ``dask-jobqueue`` clusters have one as well."""

    def __init__(self, address: str, workers: int) -> None:
        require_extra("dask", "a cluster of Dask")
        from distributed import Client  # noqa: PLC0415  # optional

        if not address:
            raise UsageError("dask: give the address of the scheduler, such as dask://127.0.0.1:8786")
        try:
            self._client = Client(f"tcp://{address}", timeout=CONNECT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise UsageError(f"no scheduler of Dask answers at {address}: {error}") from error
        self.workers = workers or sum(self._client.nthreads().values())
        if not self.workers:
            self._client.close()
            raise UsageError(
                f"the scheduler of Dask at {address} has no workers; start some: dask worker {address}"
            )

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        """See ``concurrent.futures.Executor``."""
        # pure: equal calls would be executed once; retries: a task goes on although its worker was lost
        inner = self._client.submit(function, *arguments, **options, pure=False)
        outer: Future[Any] = Future()
        outer.set_running_or_notify_cancel()
        inner.add_done_callback(lambda done: _settle(outer, done))
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster, which goes on; its runs in progress are cancelled."""
        with suppress(Exception):  # of a scheduler that is gone
            self._client.close(timeout=2.0)


def _settle(outer: Future[Any], inner: Any) -> None:
    """Pass the result of a future of Dask on."""
    try:
        if inner.cancelled():
            raise EngineLostError("the scheduler of Dask is gone")
        outer.set_result(inner.result())
    except Exception as error:
        outer.set_exception(error)
    finally:
        inner.release()


class RayExecutor(Executor):
    """A cluster of Ray, by the address of its head node."""

    def __init__(self, address: str, workers: int) -> None:
        require_extra("ray", "a cluster of Ray")
        import ray  # noqa: PLC0415  # optional

        self._ray = ray
        ends = signal.getsignal(signal.SIGTERM)
        try:
            if address:
                ray.init(address, log_to_driver=False, configure_logging=False)
            else:  # by default Ray listens on the machine's outside address
                ray.init("local", _node_ip_address="127.0.0.1", include_dashboard=False, log_to_driver=False)
        except (OSError, ConnectionError, RuntimeError, ValueError) as error:
            raise UsageError(f"no cluster of Ray answers at {address}: {error}") from error
        finally:
            if current_thread() is main_thread():  # there Ray has put a handler of its own, and leaves it
                signal.signal(signal.SIGTERM, ends)
        self.workers = workers or int(ray.cluster_resources().get("CPU", 1))

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        """See ``concurrent.futures.Executor``."""
        future: Future[Any] = self._ray.remote(function).remote(*arguments, **options).future()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave the cluster."""
        self._ray.shutdown()


executors.add("processes", ProcessExecutor)
executors.add("dask", DaskExecutor)
executors.add("ray", RayExecutor)
