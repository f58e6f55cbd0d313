"""Campaigns on real engines: the same rows on each, whatever dies meanwhile.

Processes of this machine, a cluster of Dask (a scheduler and two workers) and one of Ray, all on loopback.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread

import pytest

import volery
from rigs.small_campaigns import COUNT, DO, model, same_rows  # a fixture
from volery.base.errors import VoleryError
from volery.explore.campaign import Campaign
from volery.explore.executors import EngineLostError
from volery.explore.points import VariantPoint
from volery.explore.run_process import (
    CampaignSetting,
    PlannedRun,
    VersionMismatchError,
    execute,
    stop_processes,
)

pytestmark = pytest.mark.integration

WITHIN_S = 300
SPACE = {COUNT: [1, 3], "allocation": ["only", "slow"]}
SEEDS = 25
ROOM_B = 100_000
"""Greatest file, as if the disk ended there: fewer bytes than the rows of the campaign need."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The table of a campaign in one process, which nothing disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    made = model.__wrapped__(folder)
    return made, volery.explore(made, folder / "out", SPACE, seeds=SEEDS, workers=1).table()


def wait_for(condition: Callable[[], object]) -> None:
    until = time.monotonic() + WITHIN_S
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.01)


def finished(folder: Path) -> int:
    with suppress(VoleryError), Campaign(folder) as campaign:
        return campaign.count()[1]
    return 0


def children(pid: int) -> list[int]:
    found = []
    with suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            found += [int(one) for one in (task / "children").read_text().split()]
    return found


def start(made: Path, out: Path, *options: str, first: str = "") -> subprocess.Popen[str]:
    """Start the campaign as a command, in a process that executes *first* before."""
    paths = [f"--set={COUNT}=1,3", "--allocation=only", "--allocation=slow", f"--seeds={SEEDS}"]
    code = f"{first}\nfrom volery.cli.main import main\nmain()"
    return subprocess.Popen(
        [sys.executable, "-c", code, "explore", str(made), f"--out={out}", *paths, *options],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


# -- processes


def test_whatever_a_run_does_is_a_row(model, tmp_path):
    does = ["work", "raise", "crash", "hang", "fill"]
    limits = {"limit_ns": 4 * 10**9, "memory_b": 200e6}
    campaign = volery.explore(model, tmp_path / "out", {DO: does}, workers=2, **limits)
    rows = dict(zip(does, campaign.rows(), strict=True))
    found = {what: (row.status, row.reason) for what, row in rows.items()}
    assert found["work"] == ("completed", "")
    assert found["raise"][0] == "failed"
    assert "ValueError: out of paper" in found["raise"][1]
    assert found["crash"] == ("crashed", "its process ended by SIGABRT")
    assert found["hang"] == ("over time", "it took more than its limit of 4 s")
    assert found["fill"] == ("over memory", "its process used more than its limit of 200 MB")
    assert rows["work"].observables["note.step.done"] == 3.0
    assert rows["work"].verdicts == {"counted": False}
    (invalid,) = campaign.evaluate([VariantPoint({"platform.processors.pc.frequency": "9 GHz"}, 1)])
    assert invalid.status == "invalid"
    assert "frequency" in invalid.reason


def test_a_row_is_made_again_byte_for_byte(undisturbed, tmp_path):
    made, table = undisturbed
    out = made.parent / "out"
    with Campaign(out) as campaign:
        run = 3 * SEEDS + 1
        again = [campaign.show(run, tmp_path / name) for name in ("one", "two")]
        assert again[0].observables == campaign.row(run).observables
        assert again[0].record.seed == table["seed"][run]
        assert again[0].record.allocation == "slow"
    digests = {sha256((tmp_path / name / "trace.mcap").read_bytes()).digest() for name in ("one", "two")}
    assert len(digests) == 1
    assert (tmp_path / "one" / "report.html").exists()


def test_a_process_that_is_killed_from_outside_is_replaced(undisturbed, tmp_path):
    made, table = undisturbed
    mine = os.getpid()
    killed = []

    def kill() -> None:
        wait_for(lambda: finished(tmp_path / "out") > 5)
        killed.append(children(mine)[0])
        os.kill(killed[0], signal.SIGKILL)

    thread = Thread(target=kill)
    thread.start()
    again = volery.explore(made, tmp_path / "out", SPACE, seeds=SEEDS, workers=1).table()
    thread.join()
    assert same_rows(again, table)
    assert again["attempt"].max() <= 2


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_campaign_that_was_ended_is_resumed(undisturbed, tmp_path, number):
    made, table = undisturbed
    out = tmp_path / "out"
    process = start(made, out)
    wait_for(lambda: finished(out) > 10)
    ours = children(process.pid)
    process.send_signal(number)
    _, said = process.communicate(timeout=WITHIN_S)
    done = finished(out)
    assert 10 < done <= len(table)
    if number != signal.SIGKILL:
        assert process.returncode == 1
        assert f"interrupted after {done} of {len(table)} runs" in said
    wait_for(lambda: not any(Path(f"/proc/{one}/cmdline").exists() for one in ours))
    resumed = start(made, out, "--json")
    result, said = resumed.communicate(timeout=WITHIN_S)
    assert resumed.returncode == 0, said
    assert json.loads(result)["statuses"] == {"completed": len(table)}
    again = Campaign(out).table()
    assert same_rows(again, table)
    assert (again["attempt"] == 1).sum() >= done  # what was finished was not run again


def test_a_full_disk_is_said_and_the_campaign_goes_on_when_there_is_room(undisturbed, tmp_path):
    made, table = undisturbed
    out = tmp_path / "out"
    limit = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({ROOM_B}, {ROOM_B}))"
    process = start(made, out, first=limit)
    _, said = process.communicate(timeout=WITHIN_S)
    assert process.returncode == 1
    assert f"{out} cannot be written" in said
    assert "when there is room again, the same command resumes the campaign" in " ".join(said.split())
    assert "Traceback" not in said
    done = finished(out)
    assert 0 < done < len(table)
    resumed = start(made, out, "--json")
    _, said = resumed.communicate(timeout=WITHIN_S)
    assert resumed.returncode == 0, said
    again = Campaign(out).table()
    assert same_rows(again, table)
    assert (again["attempt"] == 1).sum() >= done


def test_a_worker_of_another_version_is_refused(model):
    setting = CampaignSetting(str(model), version="0.0.9")
    with pytest.raises(
        VersionMismatchError, match=r"has volery .* the coordinator 0\.0\.9: install the same"
    ):
        execute(PlannedRun(setting, 0, VariantPoint()))
    with pytest.raises(VersionMismatchError, match=r"differs from the coordinator's .*, not beef"):
        execute(PlannedRun(CampaignSetting(str(model), digest="beef"), 0, VariantPoint()))
    stop_processes()


# -- Dask


class DaskCluster:
    """A scheduler and workers of Dask, each a process."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "scheduler.json"
        self.environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
        self.scheduler = self._start("scheduler", "--port", "0", "--no-show", "--no-dashboard")
        wait_for(self._file.exists)
        self.workers = [self.start_worker(), self.start_worker()]

    def start_worker(self) -> subprocess.Popen[bytes]:
        return self._start("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def _start(self, what: str, *options: str) -> subprocess.Popen[bytes]:
        common = ["--host", "127.0.0.1", "--scheduler-file", str(self._file)]
        return subprocess.Popen(
            [sys.executable, "-m", "dask", what, *common, *options],
            env=self.environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    @property
    def address(self) -> str:
        return "dask://" + json.loads(self._file.read_text())["address"].removeprefix("tcp://")

    def close(self) -> None:
        for one in (*self.workers, self.scheduler):
            one.kill()
            one.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[DaskCluster]:
    made = DaskCluster(tmp_path)
    yield made
    made.close()


def test_dask_makes_the_same_rows_also_if_a_worker_dies(undisturbed, cluster, tmp_path):
    made, table = undisturbed
    out = tmp_path / "out"
    wait_for(lambda: _workers(cluster.address) == 2)

    def kill() -> None:
        wait_for(lambda: finished(out) > 10)
        cluster.workers[0].kill()

    thread = Thread(target=kill)
    thread.start()
    campaign = volery.explore(made, out, SPACE, seeds=SEEDS, on=cluster.address)
    thread.join()
    assert same_rows(campaign.table(), table)


def test_a_scheduler_that_dies_is_named_and_the_campaign_goes_on_elsewhere(undisturbed, cluster, tmp_path):
    made, table = undisturbed
    out = tmp_path / "out"
    wait_for(lambda: _workers(cluster.address) == 2)

    def kill() -> None:
        wait_for(lambda: finished(out) > 10)
        cluster.scheduler.kill()

    thread = Thread(target=kill)
    thread.start()
    with pytest.raises(EngineLostError, match=r"was lost after \d+ of 100 runs.*resumes the campaign"):
        volery.explore(made, out, SPACE, seeds=SEEDS, on=cluster.address)
    thread.join()
    again = volery.explore(made, out, SPACE, seeds=SEEDS, workers=2).table()
    assert same_rows(again, table)


class Cable:
    """A TCP connection to a server that can be cut: a proxy on loopback."""

    def __init__(self, address: str) -> None:
        host, _, port = address.removeprefix("dask://").rpartition(":")
        self._server = socket.create_server(("127.0.0.1", 0))
        self._ends: list[socket.socket] = []
        self._to = (host, int(port))
        Thread(target=self._accept, daemon=True).start()

    @property
    def address(self) -> str:
        return f"dask://127.0.0.1:{self._server.getsockname()[1]}"

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                ours, _ = self._server.accept()
                theirs = socket.create_connection(self._to)
                self._ends += [ours, theirs]
                for one, other in ((ours, theirs), (theirs, ours)):
                    Thread(target=self._pass, args=(one, other), daemon=True).start()

    def _pass(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while data := one.recv(65536):
                other.sendall(data)
            other.shutdown(socket.SHUT_WR)

    def cut(self) -> None:
        for one in (self._server, *self._ends):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()


def test_a_connection_to_the_scheduler_that_is_cut_is_named_and_the_campaign_goes_on(
    undisturbed, cluster, tmp_path
):
    made, table = undisturbed
    out = tmp_path / "out"
    wait_for(lambda: _workers(cluster.address) == 2)
    cable = Cable(cluster.address)

    def cut() -> None:
        wait_for(lambda: finished(out) > 10)
        cable.cut()

    thread = Thread(target=cut)
    thread.start()
    with pytest.raises(EngineLostError, match=r"was lost after \d+ of 100 runs.*resumes the campaign"):
        volery.explore(made, out, SPACE, seeds=SEEDS, on=cable.address)
    thread.join()
    done = finished(out)
    assert 10 < done < len(table)
    again = volery.explore(made, out, SPACE, seeds=SEEDS, on=cluster.address).table()
    assert same_rows(again, table)
    assert (again["attempt"] == 1).sum() >= done


def _workers(address: str) -> int:
    from distributed import Client

    with Client(address.replace("dask", "tcp"), set_as_default=False) as client:
        return len(client.nthreads())


# -- Ray


@pytest.fixture
def ray_settings(tmp_path, monkeypatch):
    """Keep what Ray writes about itself in the folder of the test."""
    for name, value in {
        "HOME": str(tmp_path),
        "RAY_AUTH_MODE": "disabled",
        "RAY_USAGE_STATS_ENABLED": "0",
    }.items():
        monkeypatch.setenv(name, value)


def test_ray_makes_the_same_rows(undisturbed, tmp_path, ray_settings):
    made, table = undisturbed
    before = signal.getsignal(signal.SIGTERM)
    campaign = volery.explore(made, tmp_path / "out", SPACE, seeds=SEEDS, on="ray", workers=2)
    assert same_rows(campaign.table(), table)
    assert signal.getsignal(signal.SIGTERM) == before, "Ray's handler is gone with it"


@pytest.mark.long
def test_a_ray_that_others_started_makes_the_same_rows(undisturbed, tmp_path, ray_settings):
    made, table = undisturbed
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with TemporaryDirectory(prefix="ray-") as short:  # a socket's path has 107 characters at most
        head = subprocess.Popen(
            [
                *(sys.executable, "-m", "ray.scripts.scripts", "start", "--head", "--block"),
                *("--node-ip-address", "127.0.0.1", "--port", str(port), "--num-cpus", "2"),
                *("--include-dashboard", "false", "--temp-dir", short),
            ],
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            wait_for(lambda: _answers(port))
            on = f"ray://127.0.0.1:{port}"
            campaign = volery.explore(made, tmp_path / "out", SPACE, seeds=SEEDS, on=on)
            assert same_rows(campaign.table(), table)
            assert head.poll() is None, "the cluster goes on"
        finally:
            head.terminate()  # and with it what it has started
            head.wait(WITHIN_S)


def _answers(port: int) -> bool:
    with suppress(OSError), socket.create_connection(("127.0.0.1", port), 1.0):
        return True
    return False
