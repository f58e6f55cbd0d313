"""Accelerations are cut into overlapping windows, transformed, averaged, and searched for peaks."""

import numpy as np


def prepare(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(8192) / 1000.0
    return np.sin(2 * np.pi * 83.0 * t) + 0.4 * np.sin(2 * np.pi * 210.0 * t) + rng.normal(0.0, 0.5, t.size)


def run(samples):
    size = 1024
    window = np.hanning(size)
    power = np.zeros(size // 2 + 1)
    parts = 0
    for start in range(0, samples.size - size + 1, size // 2):
        part = samples[start : start + size]
        spectrum = np.fft.rfft((part - part.mean()) * window)
        power += spectrum.real**2 + spectrum.imag**2
        parts += 1
    power /= parts
    peaks = np.nonzero((power[1:-1] > power[:-2]) & (power[1:-1] > power[2:]))[0] + 1
    strongest = peaks[np.argsort(power[peaks])[::-1][:5]]
    total = 10.0 * np.log10(power[strongest] + 1e-12)
    return float(total.sum()) + int(strongest[0])
