"""``volery ros bridge``: what makes no sense is told before anything is opened."""

import pytest
from typer.testing import CliRunner

from volery.cli.command import BAD_INPUT
from volery.cli.commands.ros import BridgeNotes
from volery.cli.console import CommandOutput
from volery.cli.main import application
from volery.trace.events import LinkState, Text


def said_of(*arguments: str) -> str:
    done = CliRunner().invoke(application(), ["ros", "bridge", *arguments])
    assert done.exit_code == BAD_INPUT
    return " ".join(done.output.split())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("sim:ardupilot", "--graph", "embedded"), "the embedded graph is inside a run"),
        (("sim:ardupilot", "--graph", "ros3"), "no graph 'ros3'"),
        (("sim:ardupilot", "--names", "roscoptr"), "did you mean 'roscopter'?"),
        (
            ("ardupilot+tcp://127.0.0.1:5760", "--names", "pprzros"),
            "of vehicles that speak pprzlink; this one goes by ardupilot, ",
        ),
        (("sim:dji", "--names", "pprzros"), "this one goes by mavros or roscopter"),
        (
            ("sim:ardupilot", "--names", "px4"),
            "are those of a px4; this one goes by ardupilot, ardupilot-4.5, mavros",
        ),
        (("sim:px4", "--names", "px4-1.13"), "did you mean 'px4-1.1"),
        (("sim:dji",), "`volery vehicle serve dji --graph ros1`"),
        (("sim:dji",), "for other names give --names mavros or roscopter"),
        (("paparazzi+ros1:///", "--names", "pprzros"), "a ROS node itself, under pprzros's names"),
        (("mavros+ros1:///mavros",), "on a graph already, under mavros's names"),
        (("px4+ros1:///mavros", "--names", "roscopter"), "there is nothing to bridge"),
        (("dji+graph:///d", "--names", "mavros"), "there is nothing to bridge"),
        (("paparazzi+udp://:0?bau=9600", "--names", "mavros"), "no option 'bau'"),
        (("sim:ardupilot", "--rate", "2000"), "1 to 1000"),
        (("sim:ardupilot", "--source-system", "0"), "0 is no system id"),
        (("sim:ardupilot", "--speed", "0"), "a speed of 0"),
        (("sim:ardupilot", "--geoid", "egm08"), "egm96, or a number of metres"),
        (("ardupilot+tcp://127.0.0.1:5760?bau=9600",), "no option 'bau' (did you mean 'baud'?)"),
        (("nonsense",), "is not an address"),
    ],
)
def test_what_makes_no_sense(arguments: tuple[str, ...], says: str) -> None:
    assert says in said_of(*arguments)


def test_a_status_is_printed_when_it_changes(capsys: pytest.CaptureFixture[str]) -> None:
    notes = BridgeNotes(CommandOutput())
    for text in ("no autopilot", "no autopilot", "an autopilot"):
        notes.status(1_000_000_000, text)
    notes.record(LinkState(2_000_000_000, "tcp://x", "lost", "the other side closed the connection"))
    notes.record(Text(3_000_000_000, "bridge", 4, "message dropped"))
    assert [line.split("  ")[1] for line in capsys.readouterr().err.splitlines()] == [
        "no autopilot",
        "an autopilot",
        "link lost: the other side closed the connection",
        "message dropped",
    ]
