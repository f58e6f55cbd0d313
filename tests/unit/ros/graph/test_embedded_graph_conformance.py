"""The embedded graph passes the checks of transports, in virtual time."""

import pytest

from volery.kernel.virtual import VirtualKernel
from volery.ros.graph import EmbeddedGraph
from volery.testing.transport_conformance import CHECKS, EMBEDDED, Site


@pytest.mark.parametrize("check", CHECKS)
def test_embedded(check: str) -> None:
    kernel = VirtualKernel()
    graph = EmbeddedGraph(kernel)
    with kernel.adopt("check"), Site(graph, check, EMBEDDED) as site:
        CHECKS[check](site)
    graph.close()
    assert kernel.close() == []
