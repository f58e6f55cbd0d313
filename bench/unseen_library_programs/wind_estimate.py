"""Wind from ground speeds on many headings: least squares, a polynomial of the residuals, their spectrum."""

import numpy as np


def prepare(seed):
    random = np.random.default_rng(seed)
    heading = np.sort(random.uniform(0.0, 2.0 * np.pi, 512))
    speed = np.stack([12.0 * np.cos(heading) + 3.0, 12.0 * np.sin(heading) - 1.5], axis=1)
    return heading, speed + random.normal(0.0, 0.3, speed.shape)


def run(flight):
    heading, speed = flight
    total = 0.0
    for first in range(0, 512, 64):
        part, angles = speed[first : first + 128], heading[first : first + 128]
        known = np.column_stack([2.0 * part[:, 0], 2.0 * part[:, 1], np.ones(len(part))])
        wind, _, _, _ = np.linalg.lstsq(known, np.sum(part**2, axis=1), rcond=None)
        rest = np.sum(part**2, axis=1) - known @ wind
        smooth = np.polyval(np.polyfit(angles, rest, 3), angles)
        spectrum = np.abs(np.fft.rfft(rest - smooth))
        total += float(wind[0] + np.interp(1.0, angles, rest) + np.max(spectrum) + np.std(np.cumsum(rest)))
    return total
