"""The ROS graph: the node interface that every transport implements, and its embedded implementation.

Knows the kernel (waiting) and messages. It must not know what a call costs nor how a message travels: both
are asked of two functions that are given from above.
"""

from volery.graph.embedded import EmbeddedNode
from volery.graph.graph import Graph
from volery.graph.node import (
    AS_OFFERED,
    BEST_AVAILABLE,
    BEST_EFFORT,
    DEFAULT,
    LATCHED,
    RELIABLE,
    SENSOR_DATA,
    TRANSIENT_LOCAL,
    VOLATILE,
    Carry,
    Client,
    Cost,
    Group,
    Handler,
    Node,
    NodeId,
    Price,
    Publisher,
    QoS,
    Rate,
    RosGraph,
    Service,
    ServiceState,
    Subscription,
    Timer,
    TopicState,
    Work,
)
from volery.graph.services import ServiceError

__all__ = [
    "AS_OFFERED",
    "BEST_AVAILABLE",
    "BEST_EFFORT",
    "DEFAULT",
    "LATCHED",
    "RELIABLE",
    "SENSOR_DATA",
    "TRANSIENT_LOCAL",
    "VOLATILE",
    "Carry",
    "Client",
    "Cost",
    "EmbeddedNode",
    "Graph",
    "Group",
    "Handler",
    "Node",
    "NodeId",
    "Price",
    "Publisher",
    "QoS",
    "Rate",
    "RosGraph",
    "Service",
    "ServiceError",
    "ServiceState",
    "Subscription",
    "Timer",
    "TopicState",
    "Work",
]
