"""A run folder as a run leaves it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from volery.requirements.accounts import Accounts
from volery.requirements.record import write_record
from volery.ros.messages.store import definition
from volery.testing.sample_run import sample_events, sample_scenery, sample_setup
from volery.trace.attachments import to_json
from volery.trace.mcap_writer import Attachment, McapWriter


@pytest.fixture
def make_run() -> Callable[..., Path]:
    """Makes the folder that is named."""

    def make(folder: Path, megahertz: float = 1500.0) -> Path:
        folder.mkdir()
        setup = sample_setup(onboard_mhz=megahertz)
        attached = [Attachment("world.json", "application/json", to_json(sample_scenery()))]
        writer, accounts = McapWriter(folder / "trace.mcap", setup, attached, definition), Accounts(setup)
        for event in sample_events(seconds=20.0, onboard_mhz=megahertz):
            writer(event)
            accounts(event)
        writer.close()
        write_record(accounts.record("completed"), folder)
        return folder

    return make
