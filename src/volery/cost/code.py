"""What counted code costs: steps times the time of a step.

Law: time = steps * cycles_per_step / f. A *step* is about one simple operation of the CPython interpreter (an
addition of two local variables and the store of its result); whoever counts weighs the others by it.

Validity: pure Python, in files that are counted, with warm caches. The figures are estimates until a machine
has been calibrated; the law says so, and a report repeats it.
"""

from __future__ import annotations

from volery.cost.figure import Figure, Stated


class CodeLaw(Stated):
    """The law of one language on one kind of processor."""

    language: str
    cycles_per_step: Figure
    calibrated: bool = False
    processor: str = ""

    def ns_per_step(self, frequency_mhz: float) -> float:
        """Target time of one step, ns."""
        return self.cycles_per_step.value * 1000.0 / frequency_mhz

    def warnings(self) -> tuple[str, ...]:
        """What a report has to say where this law is used."""
        if self.calibrated:
            return ()
        band = self.cycles_per_step.error
        within = f", within {band:.0%}" if band else ""
        what = f"the time of counted {self.language} code on {self.processor}"
        return (f"{what} is {self.provenance}{within}: uncalibrated",)
