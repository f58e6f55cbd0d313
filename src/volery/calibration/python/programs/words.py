"""Lines of settings read into a tree: splitting, stripping, nested dicts, formatting."""

from random import Random


def parse(lines):
    root = {}
    stack = [(-1, root)]
    for number, line in enumerate(lines, 1):
        bare = line.strip()
        if not bare or bare.startswith("#"):
            continue
        depth = len(line) - len(line.lstrip(" "))
        while stack[-1][0] >= depth:
            stack.pop()
        key, colon, value = bare.partition(":")
        if not colon:
            raise ValueError(f"line {number}: {bare}")
        value = value.strip()
        if value:
            stack[-1][1][key] = convert(value)
        else:
            inner = stack[-1][1].setdefault(key, {})
            stack.append((depth, inner))
    return root


def convert(text):
    if text in ("true", "false"):
        return text == "true"
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        return text


def flat(tree, path=""):
    for key, value in tree.items():
        here = f"{path}.{key}" if path else key
        if isinstance(value, dict):
            yield from flat(value, here)
        else:
            yield f"{here}={value}"


def prepare(seed):
    random = Random(seed)
    lines = []
    for group in range(12):
        lines.append(f"group_{group}:")
        for item in range(4):
            lines.append(f"  item_{item}:")
            lines.append(f"    limit: {random.random():.3f}")
            lines.append(f"    count: {random.randrange(100)}")
            lines.append(f"    kind: {random.choice(['true', 'slow', '7'])}")
            lines.append("    # a remark")
    return lines


def run(state):
    return len(list(flat(parse(state))))
