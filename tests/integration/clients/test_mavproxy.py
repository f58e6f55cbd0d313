"""MAVProxy at a served vehicle: its console flies, and what it forwards is heard."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pymavlink import DFReader

pytestmark = pytest.mark.integration

GUIDED = 4
SCRIPT = Path(sys.executable).with_name("mavproxy.py")


@pytest.fixture
def proxied(
    require: Callable[[str, str], None],
    serve: Callable[..., Any],
    station: Callable[..., Any],
    free_port: Callable[..., int],
    udp: int,
    tmp_path: Path,
) -> Any:
    """MAVProxy between a vehicle and a UDP port; its standard input is its console."""
    require("MAVProxy", "MAVProxy")
    vehicle = serve("tcp", 10.0)
    onward = free_port(udp)
    hearer = station(f"udpin:127.0.0.1:{onward}", 254)
    command = [sys.executable, str(SCRIPT), "--master", f"tcp:127.0.0.1:{vehicle.port}"]
    command += ["--out", f"udp:127.0.0.1:{onward}", "--state-basedir", str(tmp_path), "--streamrate", "4"]
    environment = {**os.environ, "HOME": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    with (tmp_path / "said").open("wb") as said:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=said, stderr=said, cwd=tmp_path, env=environment
        )
        try:
            yield process, hearer, tmp_path
        finally:
            process.kill()
            process.communicate()


@pytest.fixture
def udp() -> int:
    import socket

    return int(socket.SOCK_DGRAM)


def test_its_console_flies_and_it_forwards(proxied: Any) -> None:
    process, hearer, folder = proxied

    def order(line: str) -> None:
        process.stdin.write(f"{line}\n".encode())
        process.stdin.flush()

    hearer.meet()
    said = folder / "said"  # it reads the parameters by FTP, as of the original
    hearer.wait(
        "HEARTBEAT", lambda beat: "Received 1372 parameters (ftp)" in said.read_text(errors="replace")
    )
    hearer.wait_ready()
    order("mode GUIDED")
    hearer.wait("HEARTBEAT", lambda beat: beat.get_srcComponent() == 1 and beat.custom_mode == GUIDED)
    order("arm throttle")
    hearer.wait_armed()
    order("takeoff 10")
    hearer.wait_height(10.0)
    order("mode LAND")
    hearer.wait_armed(False)
    assert "Got COMMAND_ACK" in said.read_text(errors="replace")
    order("log list")
    hearer.wait("HEARTBEAT", lambda _: "numLogs 1" in said.read_text(errors="replace"))
    order("log download 1 one.bin")
    hearer.wait("HEARTBEAT", lambda _: "Finished downloading" in said.read_text(errors="replace"))
    order("ftp get /logs/00000001.BIN two.bin")
    hearer.wait("HEARTBEAT", lambda _: "Wrote " in said.read_text(errors="replace"))
    log = DFReader.DFReader_binary(str(folder / "one.bin"))
    heights = []
    while (message := log.recv_match(type="POS")) is not None:
        heights.append(message.RelHomeAlt)
    assert 9.5 < max(heights) < 11.0
    assert (folder / "two.bin").read_bytes() == (folder / "one.bin").read_bytes()
