"""``roscpp`` on a graph: headers that a component's C++ file includes, and what answers its questions.

``include/`` holds ``ros/ros.h`` and its kin, in place of roscpp's own; ``headers.generate`` writes the
headers of messages; ``request_handlers`` does on the graph what the code asks. Where Boost is not installed,
the little that roscpp's interface needs of it is in ``fallback/``.

As a launch file does, the component's name names the node, whatever ``ros::init`` says.

Differences from the real one, on purpose: what is not offered does not compile; a component has one flow of
control, so ``AsyncSpinner`` and ``MultiThreadedSpinner`` are refused; wall time is the time of the run;
connecting takes no time; ``Header.seq`` is not carried; callback queues of one's own, ``tf`` and
``XmlRpcValue`` are not there.
"""

from pathlib import Path

from volery.ros.client_libraries.roscpp.message_headers import INCLUDE, generate
from volery.ros.client_libraries.roscpp.node_requests import request_handlers
from volery.ros.client_libraries.roscpp.session import Session

FALLBACK = Path(__file__).parent / "fallback"

__all__ = ["FALLBACK", "INCLUDE", "Session", "generate", "request_handlers"]
