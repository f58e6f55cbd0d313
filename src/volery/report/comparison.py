"""Runs side by side in one HTML file: allocations, frequencies, scenarios of the same system."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import RenderableType

from volery.base.errors import UsageError
from volery.report.comparison_grids import all_comparisons
from volery.report.document import REPORT_FILE, environment, gather
from volery.report.grids import labels
from volery.report.terminal import comparison_table
from volery.requirements.record import RUN_FILE, RunRecord, read_record

COMPARISON_FILE = "comparison.html"


class Comparison(NamedTuple):
    """Runs side by side: as an HTML document and as a table for the terminal."""

    html: str
    table: RenderableType


def compare(folders: Sequence[Path], beside: Path | None = None) -> Comparison:
    """Compare the runs in *folders*; links to their reports are relative to the folder *beside*.

    Raises ``UsageError`` if there are fewer than two, or one holds no run.
    """
    if len(folders) < 2:
        raise UsageError(f"a comparison takes at least two run folders, not {len(folders)}")
    records = [_record(folder) for folder in folders]
    names = [folder.resolve().name for folder in folders]
    called = labels(records, names)
    html = (
        environment()
        .get_template("comparison.html.j2")
        .render(
            title=" and ".join(dict.fromkeys(record.system or "a run" for record in records)),
            subtitle=" · ".join(called),
            grids=all_comparisons(called, records),
            runs=[
                {
                    "label": label,
                    "link": _link(folder, beside),
                    "not_counted": record.not_counted,
                    "warnings": record.warnings,
                }
                for label, folder, record in zip(called, folders, records, strict=True)
            ],
            footer="volery: one model, simulated, priced and flown",
        )
    )
    return Comparison(html, comparison_table(records, names))


def write_comparison(folders: Sequence[Path], into: Path) -> Path:
    """Write ``comparison.html`` into the folder *into* and say where it is; ``UsageError`` as ``compare``."""
    path = into / COMPARISON_FILE
    text = compare(folders, into).html
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror or error}") from error
    return path


def _record(folder: Path) -> RunRecord:
    if (folder / RUN_FILE).exists():
        return read_record(folder)
    return gather(folder).record


def _link(folder: Path, beside: Path | None) -> str:
    report = folder / REPORT_FILE
    if beside is None or not report.exists():
        return ""
    return Path(os.path.relpath(report.resolve(), beside.resolve())).as_posix()
