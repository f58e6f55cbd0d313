"""One set of ROS files, run on the embedded graph and on a real one; what is said on its topics, in bytes."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from volery.ros.messages import from_cdr
from volery.run.result import Options
from volery.run.simulate import simulate
from volery.trace.events import Published
from volery.trace.reader import read

from .conftest import HERE

LIMIT_S = 200
Said = dict[str, list[bytes]]

MODEL = """
volery: 1
name: files
files_from: {folder}
components:
{components}
application:
{instances}
platform:
  processors:
    pc: {{is: intel-i5-3470, frequency: 3000 MHz}}
allocations:
  only: {{{places}}}
run: {{duration: {duration} s}}
"""


@dataclass(frozen=True)
class Case:
    """Files that run together, each with its private parameters; topics with their types, and how many
    messages of each are compared. A file waits for as many ``listeners`` as it is told.
    """

    files: Mapping[str, Mapping[str, Any]]
    topics: Mapping[str, tuple[str, int]]
    seconds: int = 20
    remaps: Mapping[str, str] = field(default_factory=dict)

    def observed_files(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """The files where an observer listens as well."""
        for name, given in self.files.items():
            more = {"listeners": given["listeners"] + 1} if "listeners" in given else {}
            yield name, {**given, **more}


def embedded(case: Case, language: str, folder: Path, out: Path) -> Said:
    """Run the case in virtual time."""
    out.mkdir(exist_ok=True)
    components = "\n".join(
        f"  {name.title()}: {{language: {language}, path: {folder / name}.py, active: true}}"
        for name in case.files
    )
    instances = "\n".join(
        f"  {name}: {{is: {name.title()}, parameters: {json.dumps(dict(given))}, "
        f"remap: {json.dumps(dict(case.remaps))}}}"
        for name, given in case.files.items()
    )
    places = ", ".join(f"{name}: pc" for name in case.files)
    model = out / "model.yaml"
    model.write_text(
        MODEL.format(
            folder=folder,
            components=components,
            instances=instances,
            places=places,
            duration=case.seconds,
        )
    )
    run = simulate(model, Options("code", out=out / "run"))
    assert run.completed, run.error
    said: Said = {topic: [] for topic in case.topics}
    for event in read(out / "run" / "trace.mcap").events:
        if isinstance(event, Published) and event.topic in said:
            said[event.topic].append(event.data)
    return said


@contextmanager
def running(
    commands: Sequence[Sequence[str]], surroundings: Mapping[str, str]
) -> Iterator[list[subprocess.Popen[str]]]:
    """Programs that are interrupted at the end, as Ctrl-C would."""
    with ExitStack() as stack:
        started = []
        for command in commands:
            process = subprocess.Popen(
                command, env=surroundings, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
            )
            stack.callback(_end, process)
            started.append(process)
        yield started


def _end(process: subprocess.Popen[str]) -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.communicate(timeout=5)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()


@contextmanager
def observed(
    python: str, graph: str, case: Case, folder: Path, surroundings: Mapping[str, str]
) -> Iterator[Callable[[], Said]]:
    """Our node on the real graph listens; gives what waits until all has been said that is compared."""
    topics = [f"{topic}={kind}={count}" for topic, (kind, count) in case.topics.items()]
    process = subprocess.Popen(
        [python, str(HERE / "observer.py"), graph, str(folder), str(LIMIT_S), *topics],
        env=surroundings,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        text=True,
    )

    def result() -> Said:
        heard = json.loads(process.communicate(timeout=LIMIT_S + 20)[0])
        return {topic: [bytes.fromhex(one) for one in said] for topic, said in heard.items()}

    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "ready\n"
        yield result
    finally:
        process.kill()
        process.communicate()


def compare(case: Case, embedded_says: Said, real_says: Said) -> None:
    """Byte for byte, as much as the case says of each topic."""
    for topic, (kind, count) in case.topics.items():
        ours, theirs = embedded_says[topic][:count], real_says[topic][:count]
        assert len(ours) == count, f"{topic}: {len(ours)} of {count} {kind} on the embedded graph"
        assert [from_cdr(kind, one) for one in ours] == [from_cdr(kind, one) for one in theirs], topic
        assert ours == theirs, topic
