"""``volery report``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from volery.cli.console import Output
from volery.cli.endings import OK
from volery.report.document import recover
from volery.report.terminal import comparison_table, summary_table


def report(output: Output, folders: Sequence[Path]) -> int:
    """Write ``report.html`` into each folder and show what the runs came to."""
    found = [recover(folder) for folder in folders]
    records = [one.record for one in found]
    if len(records) == 1:
        output.show(summary_table(records[0]))
    else:
        output.show(comparison_table(records, [folder.name for folder in folders]))
    as_text = [record.model_dump_json(by_alias=True, indent=2) for record in records]
    output.give(as_text[0] if len(as_text) == 1 else f"[{', '.join(as_text)}]")
    for one in found:
        output.note(f"report: {one.report}")
        if one.lost:
            output.note(f"  {one.lost}")
    return OK
