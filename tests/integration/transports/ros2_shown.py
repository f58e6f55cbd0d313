"""Asks ``volery graph ros2`` until it shows a topic; says as JSON what it showed then."""

import subprocess
import sys

COMMAND = (sys.executable, "-c", "from volery.cli.main import main; main()")


def main(topic: str) -> None:
    shown = ""
    while topic not in shown:
        asked = [*COMMAND, "graph", "ros2", "--within", "0", "--json"]
        shown = subprocess.run(asked, capture_output=True, text=True, timeout=60, check=True).stdout
    sys.stdout.write(shown)


if __name__ == "__main__":
    main(sys.argv[1])
