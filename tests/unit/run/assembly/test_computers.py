"""Artificial load: as much as was asked for, the same each time, and in everybody's way."""

from __future__ import annotations

import pytest

from volery.base.time import MS, S
from volery.kernel.processor import Processor
from volery.kernel.task import ExecutionContext
from volery.kernel.virtual import VirtualKernel
from volery.model.system import ProcessorSpec as ProcessorModel
from volery.run.assembly.computers import load_name, start_background_load
from volery.trace.events import Slice


def loaded(share, cores=2, seed=1, work=0):
    events = []
    kernel = VirtualKernel(events.append)
    processor = Processor(kernel, "onboard", cores=cores)
    start_background_load(kernel, processor, ProcessorModel("onboard", "any", 1e9, cores, load=share), seed)
    kernel.spawn(lambda: kernel.consume(work), "loop", ExecutionContext("loop", processor, 99))
    kernel.run(1 * S)
    kernel.close()
    return [event for event in events if isinstance(event, Slice)]


def executed(slices, component):
    return sum(one.end - one.start for one in slices if one.component == component)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_it_takes_its_share_of_all_cores(share):
    slices = loaded(share)
    assert executed(slices, load_name("onboard")) / (2 * S) == pytest.approx(share, rel=0.1)


def test_it_is_the_same_for_the_same_seed_and_another_for_another():
    assert loaded(0.3) == loaded(0.3)
    assert loaded(0.3) != loaded(0.3, seed=2)


def test_without_it_there_is_none():
    assert loaded(0.0) == []


def test_components_have_what_it_leaves():
    done = [one.end for one in loaded(0.5, cores=1, work=200 * MS) if one.component == "loop"]
    assert done[-1] == pytest.approx(400 * MS, rel=0.1)
