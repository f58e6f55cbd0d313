"""Settings of the simulated Paparazzi as parameters, and what it has no messages for."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.base.errors import CapabilityError, Refused, UsageError
from volery.run.connect import connect


def test_settings_are_read_written_and_saved(tmp_path: Path) -> None:
    with connect("sim:paparazzi") as drone:
        drone.wait_ready()
        before = drone.parameters.all()
        assert before["mode"] == drone.parameters.get("autopilot.mode")
        drone.parameters.save(tmp_path / "settings.param")
        drone.parameters.set("telemetry_mode_Main", before["telemetry_mode_Main"] + 1.0)
        [changed] = drone.parameters.load(tmp_path / "settings.param")
        assert (changed.name, changed.there) == ("telemetry_mode_Main", before["telemetry_mode_Main"])
        assert drone.parameters.all() == before


def test_what_is_no_setting_or_commands_the_aircraft_is_refused() -> None:
    with connect("sim:paparazzi") as drone:
        drone.wait_ready()
        with pytest.raises(UsageError, match=r"no setting 'kil_throttle'"):
            drone.parameters.get("kil_throttle")
        with pytest.raises(Refused, match="it commands the aircraft"):
            drone.parameters.set("kill_throttle", 0)
        with pytest.raises(Refused, match="it goes from 0 to 9"):
            drone.parameters.set("telemetry_mode_Main", 10)


def test_what_has_no_messages_is_a_missing_capability() -> None:
    with connect("sim:paparazzi") as drone:
        drone.wait_ready()
        for request in (
            drone.plan.download,
            drone.plan.clear,
            drone.logs.list,
            drone.payload.open_gripper,
            drone.reboot,
        ):
            with pytest.raises(CapabilityError, match="Paparazzi has no messages for it"):
                request()
