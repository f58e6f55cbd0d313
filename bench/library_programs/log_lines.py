"""Lines of a log taken apart with regular expressions."""

import re

LINE = re.compile(r"(\d+\.\d+) (\w+): (alt|vel)=(-?\d+\.\d+)")


def run(seed):
    lines = [
        f"{k * 0.1:.1f} drone{k % 3}: {'alt' if k % 2 else 'vel'}={k * 0.25 - 10:.2f}" for k in range(300)
    ]
    high = {}
    for line in lines:
        found = LINE.match(line)
        if found is None:
            continue
        _, name, what, value = found.groups()
        if what == "alt":
            high[name] = max(high.get(name, -1e9), float(value))
    words = re.sub(r"drone", "d", "\n".join(lines))
    return len(high) + len(re.findall(r"d[0-2]", words))


def prepare(seed):
    return seed
