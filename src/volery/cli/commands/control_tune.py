"""``volery control tune``: gains of a control loop from a relay experiment."""

from __future__ import annotations

from math import isfinite, isnan
from pathlib import Path
from typing import Annotated

import typer

from volery.base.files import write_text
from volery.cli.command import OK, Commands
from volery.cli.commands.control_go import By, On, SwitchOptions
from volery.cli.console import CommandOutput, make_table, number_column
from volery.cli.options import Out, Seed

commands = Commands("control", "Fly by control laws of this program or by hand; tune loops, judge responses.")


@commands.add("quiet", "json", "debug")
def tune(
    output: CommandOutput,
    loop: Annotated[str, typer.Argument(metavar="rotation|altitude", help="Loop to tune.")],
    on: On,
    switch: SwitchOptions,
    gains: Annotated[
        Path,
        typer.Option(
            metavar="FILE", help="TOML file to write the gains into, for `volery control go --gains`."
        ),
    ] = Path("gains.toml"),
    by: By = "attitude",
    seed: Seed = 1,
    out: Out = None,
) -> int:
    """Let a relay oscillate a loop in flight, fit the process, and compute gains with margins."""
    from volery.cli.run_display import run_folder
    from volery.control.tuning import as_toml
    from volery.run.go import GoSettings
    from volery.run.result import Options
    from volery.run.tune import tune as tune_loop

    settings = GoSettings(by=by, switch=switch.settings(on, output))
    with run_folder(out, f"tune-{loop}") as folder:
        options = Options(fidelity="hardware", seed=seed, out=folder)
        found = tune_loop(loop, on, settings, options, output.note)
    process, wave = found.process, found.oscillation
    output.show(
        f"relay: period {wave.period_s:.2f} s, amplitude {wave.amplitude:.3g}, "
        f"ultimate gain {wave.ultimate_gain:.3g}\n"
        f"process: gain {process.gain:.3g}, rate loop {process.frequency:.2f} rad/s with damping "
        f"{process.damping:.2f}, acceleration {process.acceleration:.3g}, dead time {process.dead_s:.2f} s, "
        f"misfit {process.misfit:.3g}"
    )
    names = ("kp", "ki", "kd")
    columns = (*names, "gain margin", "phase margin", "Ms", "IAE, fitted", "IAE, flown", "over")
    table = make_table(
        "gains", *map(number_column, columns), title="IAE per unit of step, held-back scenarios"
    )
    for one in found.judged:
        flown = ("–", "–") if isnan(one.flown) else (f"{one.flown:.3f}", f"{one.overshoot:.1%}")
        table.add_row(
            one.name,
            *(f"{float(getattr(one.gains, name)):.3g}" for name in names),
            f"{one.margins.gain:.2f}",
            f"{one.margins.phase:.0f}°",
            f"{one.margins.sensitivity:.2f}",
            f"{one.modelled:.3f}",
            *flown,
        )
    output.show(table)
    write_text(gains, as_toml(found.loop.name, found.best, f"volery control tune {loop} on {on}"))
    output.give(
        {
            "process": {
                name: value if isfinite(value) else None for name, value in process._asdict().items()
            },
            "oscillation": wave._asdict(),
            "gains": {
                one.name: {name: float(getattr(one.gains, name)) for name in (*names, "deceleration")}
                | one.margins._asdict()
                | {"modelled": one.modelled, "flown": None if isnan(one.flown) else one.flown}
                for one in found.judged
            },
        }
    )
    output.note(f"gains: {gains}; volery control go {loop} --gains {gains} flies with them")
    return OK
