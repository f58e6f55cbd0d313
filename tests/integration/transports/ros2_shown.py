"""Asks ``volery ros graph ros2`` until it shows all that is named, and twice the same; says it as JSON."""

import subprocess
import sys

COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")


def main(named: list[str]) -> None:
    shown, before = "", "-"
    while shown != before or not all(f'"{name}"' in shown for name in named):
        before = shown
        asked = [*COMMAND, "ros", "graph", "ros2", "--within", "0", "--json"]
        shown = subprocess.run(asked, capture_output=True, text=True, timeout=200, check=True).stdout
    sys.stdout.write(shown)


if __name__ == "__main__":
    main(sys.argv[1].split(","))
