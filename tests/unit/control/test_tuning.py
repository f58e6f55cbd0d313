"""Tuning against closed forms and against python-control."""

import control
import numpy as np
import pytest

from volery.base.errors import UsageError
from volery.control.laws import OnOffGains, PidGains, on_off
from volery.control.tuning import (
    INTEGRATION_S,
    Process,
    as_toml,
    cost,
    fit_process,
    is_robust,
    margins,
    open_loop,
    optimise,
    relay_oscillation,
    scenarios,
    simc,
)

PROCESS = Process(0.9, 5.0, 0.7, 0.1)
BASE = PidGains(kp=1.0, ki=0.1, kd=0.1, filter_s=0.05, low=-200.0, high=200.0, deceleration=150.0)


def relay_record(process: Process, seconds: float, amplitude: float, hysteresis: float):
    """Return times, values, errors and outputs of a relay on a process, sampled at 20 Hz."""
    every, delay = round(0.05 / INTEGRATION_S), round(process.dead_s / INTEGRATION_S)
    value, rate, change, output = -1.0, 0.0, 0.0, 0.0
    sent, rows = [0.0] * (delay + 1), []
    relay = OnOffGains(amplitude=amplitude, hysteresis=hysteresis)
    for index in range(round(seconds / INTEGRATION_S)):
        if index % every == 0:
            terms, output = on_off(relay, output, 0.0, value)
            rows.append((index * INTEGRATION_S, value, float(terms.error), float(output)))
        sent.append(float(output))
        own = process.frequency
        wanted = process.gain * sent[-1 - delay]
        change += INTEGRATION_S * own * (own * (wanted - rate) - 2.0 * process.damping * change)
        change = min(process.acceleration, max(-process.acceleration, change))
        rate += INTEGRATION_S * change
        value += INTEGRATION_S * rate
    return np.array(rows).T


@pytest.mark.parametrize(
    "process", [PROCESS, Process(1.1, 3.0, 1.0, 0.3), Process(1.0, 10.0, 0.7, 0.1, acceleration=200.0)]
)
def test_the_process_is_found_again(process):
    times, values, _, outputs = relay_record(process, 30.0, 60.0, 2.0)
    found = fit_process(times, values, outputs)
    assert found.gain == pytest.approx(process.gain, rel=0.1)
    assert found.misfit < 0.05 * np.std(values)
    if np.isfinite(process.acceleration):
        assert found.acceleration == pytest.approx(process.acceleration, rel=0.25)
    for frequency in (0.5, 1.5, 3.0):  # the phase counts, not which part of it is dead time
        one, other = (
            -2.0 * p.damping * frequency / p.frequency - frequency * p.dead_s for p in (found, process)
        )
        assert one == pytest.approx(other, abs=0.25)


def test_the_relay_gives_the_ultimate_gain():
    times, _, errors, outputs = relay_record(PROCESS, 40.0, 60.0, 0.0)
    found = relay_oscillation(times, errors, outputs, 0.0)
    frequencies = np.geomspace(0.1, 30, 20000)
    s = 1j * frequencies
    loop = PROCESS.gain * np.exp(-s * (PROCESS.dead_s + 0.025)) / s
    loop = loop * 25.0 / (s * s + 7.0 * s + 25.0)
    index = int(np.argmin(np.abs(np.unwrap(np.angle(loop)) + np.pi)))
    assert found.period_s == pytest.approx(2.0 * np.pi / frequencies[index], rel=0.1)
    assert found.ultimate_gain == pytest.approx(1.0 / abs(loop[index]), rel=0.15)  # a describing function


@pytest.mark.parametrize(
    ("kp", "ki", "kd"), [(0.5, 0.0, 0.0), (1.5, 0.3, 0.0), (2.0, 0.1, 0.3), (3.5, 0.0, 0.1)]
)
def test_margins_are_those_of_python_control(kp, ki, kd):
    gains, sample_s = PidGains(kp=kp, ki=ki, kd=kd, filter_s=0.05), 0.05
    frequencies = np.geomspace(1e-2, np.pi / sample_s, 400)
    data = control.FRD(open_loop(gains, PROCESS, sample_s, frequencies), frequencies)
    gain, phase, _, _, _, _ = control.stability_margins(data)
    found = margins(gains, PROCESS, sample_s)
    assert found.gain == pytest.approx(gain, rel=0.02)
    assert found.phase == pytest.approx(phase, abs=1.0)


def test_simc_has_the_margins_of_its_rule():
    found = margins(simc(PROCESS, BASE), PROCESS, 0.01)
    assert found.gain > 2.0
    assert found.phase > 40.0


def test_copies_cost_what_single_ones_cost():
    tests = scenarios([45.0, 120.0], 0.1, 2.0, 6, 1)
    together = cost(PidGains(kp=np.array([1.0, 1.5])), PROCESS, tests, 4.0)
    apart = [cost(PidGains(kp=kp), PROCESS, tests, 4.0)[0] for kp in (1.0, 1.5)]
    assert together == pytest.approx(apart)


def test_tuned_gains_beat_the_start_on_scenarios_that_were_held_back():
    training = scenarios([45.0, 120.0], 0.1, 2.0, 4, 1)
    held_back = scenarios([60.0, 170.0], 0.1, 2.0, 8, 77)
    tuned = optimise(PROCESS, BASE, training, 3.0)
    assert is_robust(tuned, PROCESS)
    assert cost(tuned, PROCESS, held_back, 6.0)[0] < cost(BASE, PROCESS, held_back, 6.0)[0]
    assert tuned == optimise(PROCESS, BASE, training, 3.0)


def test_gains_are_written_as_they_are_read(tmp_path):
    from volery.run.gains import read_gains

    file = tmp_path / "gains.toml"
    file.write_text(as_toml("yaw", BASE, "tuned"))
    assert read_gains(file, {"yaw": BASE}) == {"yaw": BASE}


def test_experiments_that_show_nothing_are_refused():
    times = np.arange(0.0, 5.0, 0.05)
    still = np.zeros_like(times)
    with pytest.raises(UsageError, match="oscillations"):
        relay_oscillation(times, still, still, 0.0)
    with pytest.raises(UsageError, match="nothing moves"):
        fit_process(times, still, still)
    with pytest.raises(UsageError, match="does not follow"):
        fit_process(times, -np.cumsum(np.sin(times)), np.sin(times))
