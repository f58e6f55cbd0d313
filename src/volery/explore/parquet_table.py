"""The table of a campaign as Parquet, written in parts: what it needs in memory does not grow with the rows.

Arrow arrays are made from buffers here. ``pyarrow.array`` imports pandas to see whether it was given some of
its objects, which takes 50 MB and half a second.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from volery.explore.campaign_store import CampaignStore

if TYPE_CHECKING:
    import pyarrow as pa

PART: Final = 10_000
"""Rows that are held at a time."""


def write_parquet(store: CampaignStore, path: Path) -> None:
    """Write the finished rows of a campaign, with the columns of ``CampaignStore.columns``.

    Needs the extra ``explore``. The file is there as a whole or not at all.
    """
    import pyarrow as pa  # noqa: PLC0415  # optional
    from pyarrow.parquet import ParquetWriter  # noqa: PLC0415

    arrow = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), str: pa.string()}
    kinds = store.kinds()
    types = {f"set.{name}": arrow[kind] for name, kind in kinds.items()}
    unfinished = path.with_name(f".{path.name}.part")
    last, writer = -1, None
    while True:
        columns = store.columns(kinds, last, PART)
        rows = len(columns["run"])
        if writer is None:
            fields = [(name, types.get(name) or _arrow_type(name, one)) for name, one in columns.items()]
            schema = pa.schema(fields)
            writer = ParquetWriter(unfinished, schema)
        elif not rows:
            break
        arrays = [_arrow_array(columns[one.name], one.type) for one in schema]
        writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
        if rows < PART:
            break
        last = int(columns["run"][-1])
    writer.close()
    unfinished.replace(path)


def _arrow_type(name: str, values: Any) -> pa.DataType:
    """Return the type of a column that is not a value of the points."""
    import pyarrow as pa  # noqa: PLC0415  # optional

    if isinstance(values, np.ndarray):
        return pa.from_numpy_dtype(values.dtype)
    return pa.bool_() if name.startswith("met.") else pa.string()


def _arrow_array(values: Any, kind: pa.DataType) -> pa.Array[Any]:
    """Return an array, or a list with None where nothing is, as one of the type: of four."""
    import pyarrow as pa  # noqa: PLC0415  # optional

    if isinstance(values, np.ndarray):
        return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(values)])
    known = pa.py_buffer(_bits([value is not None for value in values]))
    if pa.types.is_string(kind):
        texts = [b"" if value is None else str(value).encode() for value in values]
        ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
        data = [pa.py_buffer(ends), pa.py_buffer(b"".join(texts))]
    elif pa.types.is_boolean(kind):
        data = [pa.py_buffer(_bits([bool(value) for value in values]))]
    else:
        numbers = np.array([value or 0 for value in values], dtype=kind.to_pandas_dtype())
        data = [pa.py_buffer(numbers)]
    return pa.Array.from_buffers(kind, len(values), [known, *data])


def _bits(flags: Sequence[bool]) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return flags in the order of Arrow, the first in the lowest bit."""
    return np.packbits(np.array(flags, dtype=bool), bitorder="little")
