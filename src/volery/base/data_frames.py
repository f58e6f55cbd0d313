"""Tables as pandas data frames: pandas is optional, and imported only when a data frame is made."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from volery.base.errors import UsageError


def to_frame(columns: Mapping[str, Any], index: str) -> Any:
    """Return a ``pandas.DataFrame``.

    Args:
        columns: Columns of the same length, by name.
        index: Name of the column that is the index.

    Raises:
        UsageError: pandas is not installed.
    """
    try:
        pandas = import_module("pandas")
    except ModuleNotFoundError:
        raise UsageError("a data frame needs pandas: pip install pandas") from None
    frame = pandas.DataFrame(dict(columns))
    return frame.set_index(index) if index in frame else frame
