"""What a serial line expected when its device cannot be opened."""

from __future__ import annotations

import errno

import pytest
import serial

from volery.links.stream_links import SerialLink


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (
            serial.SerialException(errno.EACCES, "could not open port /dev/ttyUSB0: Permission denied"),
            "no permission to open /dev/ttyUSB0; add yourself to its group, usually dialout",
        ),
        (
            serial.SerialException(errno.ENOENT, "could not open"),
            "there is no device /dev/ttyUSB0; list them",
        ),
        (serial.SerialException("device disconnected"), "/dev/ttyUSB0: device disconnected"),
        (OSError(errno.EIO, "Input/output error"), "/dev/ttyUSB0: Input/output error"),
    ],
)
def test_errors_of_opening_are_explained(error: OSError, expected: str) -> None:
    line = SerialLink.__new__(SerialLink)  # without its reader's thread
    line._device = "/dev/ttyUSB0"
    assert expected in line._explain(error)
