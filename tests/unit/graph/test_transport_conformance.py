"""The embedded graph passes the checks of transports, in virtual time."""

from typing import NamedTuple

import pytest

from volery.graph import Graph
from volery.kernel.virtual import VirtualKernel
from volery.testing.transports import CHECKS, EMBEDDED, Site


class Free(NamedTuple):
    caller: int = 0
    background: int = 0


@pytest.mark.parametrize("check", CHECKS)
def test_embedded(check: str) -> None:
    kernel = VirtualKernel()
    graph = Graph(
        kernel,
        lambda node, call, x: Free(),
        lambda sender, receiver, size, reliable, deliver, lost: kernel.call_at(kernel.now(), deliver),
    )
    with kernel.adopt("check"), Site(graph, check, EMBEDDED) as site:
        CHECKS[check](site)
    graph.close()
    assert kernel.close() == []
