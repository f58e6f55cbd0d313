"""What counted code costs on a processor.

Law: time = reference time x slowdown x at_mhz / f. The reference time is what the code's operations take on
the machine of the table in ``interpreter``; the slowdown is how many times as long a processor takes that
runs at ``at_mhz``. That it goes with 1/f is what a Raspberry Pi 4 showed: 158.3 s at 1500 MHz and 401.5 s at
600 MHz for the same Python program, 2.54 for 2.5 (C. Mehta, *Performance Analysis of Languages on Raspberry
Pi*).

Validity: pure Python, in files that are counted, with warm caches. The error has two parts: that of the
operations, measured on whole programs, and that of the slowdown.
"""

from __future__ import annotations

from volery.cost.figure import Figure, Stated
from volery.cost.interpreter import STEPS_PER_NS, OperationTable, python_operations


class CodeLaw(Stated):
    """The law of one language on one kind of processor."""

    language: str
    slowdown: Figure
    at_mhz: float
    processor: str = ""

    def ns_per_step(self, frequency_mhz: float) -> float:
        """Target time of one counted step, ns."""
        return self.slowdown.value * self.at_mhz / frequency_mhz / STEPS_PER_NS

    @property
    def operations(self) -> OperationTable:
        """The table behind it."""
        return python_operations()

    @property
    def error(self) -> float | None:
        """Relative, to be expected of a program's time; ``None`` where the slowdown's is not known."""
        if self.slowdown.error is None:
            return None
        return self.operations.mean_error + self.slowdown.error

    def how_good(self) -> str:
        """In words: the error and what it consists of."""
        table, slowdown = self.operations, self.slowdown
        whole = "unknown" if self.error is None else f"{self.error:.0%}"
        factor = "" if slowdown.error is None else f" within {slowdown.error:.0%}"
        return (
            f"expected error {whole}: operations {table.provenance} ({table.mean_error:.0%} on average, "
            f"{table.worst_error:.0%} at worst, over {table.programs} programs), "
            f"the factor to this processor {slowdown.provenance}{factor}"
        )

    def warnings(self) -> tuple[str, ...]:
        """What a report has to say where this law is used."""
        if self.slowdown.provenance == "measured":
            return ()
        return (
            f"the time of counted {self.language} code on {self.processor}: {self.how_good()}; "
            "run volery calibrate python on such a computer for a measured one",
        )
