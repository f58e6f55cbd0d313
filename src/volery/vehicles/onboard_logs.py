"""The logs on board of an autopilot: list and download."""

from __future__ import annotations

from pathlib import Path

from volery.base.errors import Refused
from volery.vehicles.onboard_files import Show, check_absent, write_parts
from volery.vehicles.services import LogEntry, Services
from volery.vehicles.telemetry import Telemetry

PIECE = 9_000
"""Bytes that are requested at once: a hundred messages, so that little is sent again after a loss."""


class OnboardLogs:
    """Logs of one autopilot.

    Args:
        telemetry: telemetry of the vehicle.
        services: services of its autopilot.
    """

    def __init__(self, telemetry: Telemetry, services: Services) -> None:
        self._telemetry = telemetry
        self._services = services

    def list(self) -> list[LogEntry]:
        """Return the logs on board, oldest first. ``Refused`` while armed: ArduPilot does not answer then."""
        self._check_disarmed("list its logs")
        return self._services.list_logs()

    def download(self, entry: LogEntry, file: str | Path, show: Show | None = None) -> Path:
        """Download a log into a file, which may not exist.

        What has arrived is kept if the transfer ends early, and the next call goes on from there.

        Args:
            entry: the log, from ``list()``.
            file: path of the file; ArduPilot's logs end in .bin, PX4's in .ulg.
            show: called with the bytes that have arrived and the size of the log. It must not block.

        Returns:
            The path of the file.
        """
        self._check_disarmed(f"read log {entry.number}")
        check_absent(file)
        try:
            return write_parts(
                file, entry.size, lambda have: self._services.read_log(entry, have, PIECE), show
            )
        finally:
            self._services.end_log_transfer()

    def _check_disarmed(self, asked: str) -> None:
        if self._telemetry.armed:
            raise Refused(self._telemetry.name, asked, "it is armed; land and disarm first")
