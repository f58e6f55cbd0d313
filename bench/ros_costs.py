"""ROS calls, estimated and measured on this machine: the paper's Tables III and IV for other nodes.

Ten rounds. In each, a probe of roscpp and one of rospy measure what calls cost (calibration), while the
nodes of each library run on a real master and are measured from outside: both see the same machine, whatever
else it does. What is estimated is a simulation of the
same models, priced with the medians of the calibration. The nodes stand in bench/ros_nodes and were written
before anything was calibrated. No coefficient is fitted to them, but what a law distinguishes was extended
after looking at their differences (docs/calibration.md). An estimate holds if it is off by at most 15 % or
half the inter-quartile range of the measured runs.

    python bench/ros_costs.py [--rounds 10] [--client roscpp --client rospy]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import TypeVar

from rich.console import Console

from volery.base.errors import UsageError
from volery.calibration.host_machine import put_law, this_machine
from volery.calibration.node_comparison import NodeComparison, compare, estimate_nodes, prepare_nodes
from volery.calibration.node_processes import MeasuredRun, measurement_session
from volery.calibration.ros.call_costs import CallCost, Round, call_costs
from volery.calibration.ros.campaign import Conditions, RoundPlan, format_line, ros_law, write_entry
from volery.calibration.ros.probe_environment import Pace, check_client, probe_setup
from volery.cli.commands.cost import comparison_tables
from volery.cost import load_catalogue
from volery.model.system import System
from volery.model.system_loader import load
from volery.ros.transports.ros1.master import own_roscore
from volery.run.assembly.model_checks import vocabulary

NODES = Path(__file__).parent / "ros_nodes"
PACE = Pace(block_ms=400.0, sleeps_ms=(10.0, 20.0, 50.0, 100.0, 200.0))
SECONDS = 10

Done = TypeVar("Done")


class Campaign:
    """Calibration and measurement of one client library."""

    def __init__(self, client: str, folder: Path) -> None:
        self.client = client
        self.machine = this_machine()
        self.catalogue = folder / f"{client}.yaml"
        self.rounds: list[Round] = []
        self.runs: list[MeasuredRun] = []
        self.plan = RoundPlan(pace=PACE)
        self._stack = ExitStack()

    def open(self) -> None:
        """Compile, and start all that stays."""
        system = self.system()
        nodes = prepare_nodes(system)
        self.stage = self._stack.enter_context(probe_setup(self.client))
        core = self._stack.enter_context(own_roscore())
        self._run = self._stack.enter_context(measurement_session(nodes, core.uri, system.limits.duration_ns))

    def close(self) -> None:
        self._stack.close()

    def system(self, *changes: str) -> System:
        return load(
            NODES / f"{self.client}.yaml", vocabulary(), None, None, [f"run.duration={SECONDS} s", *changes]
        )

    def round(self) -> None:
        """Calibrate and measure, at the same time: what else the machine does touches both alike."""
        with ThreadPoolExecutor(1) as pool:
            probe = pool.submit(self.stage.probe, self.plan.pace_of(len(self.rounds)))
            self.runs.append(self._run())
            self.rounds.append(probe.result())

    def costs(self) -> dict[str, CallCost]:
        return call_costs(self.rounds)

    def result(self) -> tuple[System, tuple[NodeComparison, ...]]:
        """Estimated with all rounds, beside all runs."""
        machine, mhz = self.machine, self.machine.frequency_mhz
        under = Conditions(self.client, machine.description, mhz)
        write_entry(self.catalogue, machine, ros_law(self.costs(), under))
        code = (
            load_catalogue().processor("generic-host").code["python"]
        )  # a thousandth of what the nodes take
        put_law(self.catalogue, machine, ("code", "python"), code, (mhz, mhz))
        host = f"{{is: {machine.name}, frequency: {mhz:g} MHz}}"
        system = self.system(f"platform.catalogues={self.catalogue}", f"platform.processors.host={host}")
        return system, compare(system, estimate_nodes(system), self.runs)


def together(campaigns: list[Campaign], what: Callable[[Campaign], Done]) -> list[Done]:
    with ThreadPoolExecutor(len(campaigns)) as pool:
        return list(pool.map(what, campaigns))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=10, help="of calibration and measurement each")
    parser.add_argument("--client", action="append", choices=("roscpp", "rospy"))
    wanted = parser.parse_args()
    clients = wanted.client or ("roscpp", "rospy")
    try:
        for client in clients:
            check_client(client)
    except UsageError as error:
        print(error)
        return
    console = Console(width=120)
    with TemporaryDirectory() as folder:
        campaigns = [Campaign(client, Path(folder)) for client in clients]
        try:
            together(campaigns, Campaign.open)
            for number in range(wanted.rounds):
                Console(stderr=True).print(f"round {number + 1} of {wanted.rounds}")
                together(campaigns, Campaign.round)
        finally:
            together(campaigns, Campaign.close)
        machine = campaigns[0].machine
        console.print(f"{machine.description}, {machine.cores} cores, {machine.frequency_mhz:g} MHz")
        for one in campaigns:
            show(console, one)


def show(console: Console, one: Campaign) -> None:
    rounds = len(one.rounds)
    console.print(
        f"\n[bold]{one.client}: what calls cost the process, µs (n subscribers, ms slept), {rounds} rounds"
    )
    for call, cost in one.costs().items():
        sure = f"known to {cost.half_width:.0%}, quartiles ±{cost.spread / 2:.0%}"
        console.print(f"  {call:<20}{format_line(cost.whole, call):<20}{sure}", highlight=False)
    system, found = one.result()
    console.print(*comparison_tables(found, system))
    off = median(abs(node.difference) for node in found)
    far = [node.node for node in found if not node.holds]
    console.print(
        f"{one.client}: median difference {off:.1%}; too far: {', '.join(far) or 'none'}", highlight=False
    )


if __name__ == "__main__":
    main()
