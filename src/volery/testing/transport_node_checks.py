"""Checks of names, nodes, callback groups, services, parameters and timers on any graph."""

from __future__ import annotations

from typing import Any

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.kernel.task import ExecutionContext
from volery.ros.graph.endpoints import ServiceError
from volery.ros.graph.work import Work
from volery.ros.messages import new, request, service
from volery.testing.checks import demand, raising
from volery.testing.transport_site import LIMIT, Site, check

STRING = "std_msgs/msg/String"
TRIGGER = "std_srvs/srv/Trigger"


@check
def names_resolve(site: Site) -> None:
    """Check that relative, private, absolute and remapped names are resolved by ROS's rules."""
    node = site.node("node", "/deep", remaps={"in": "/elsewhere", "~mine": "yours"})
    space = f"{site.space}/deep"
    demand(node.name == f"{space}/node", f"its name is {node.name}")
    expected = {
        "a": f"{space}/a",
        "a/b": f"{space}/a/b",
        "/a": "/a",
        "~a": f"{space}/node/a",
        "in": "/elsewhere",
        "~mine": f"{space}/yours",
    }
    for name, full in expected.items():
        demand(node.resolve(name) == full, f"{name} resolves to {node.resolve(name)}, not {full}")
    for wrong in ("", "1a", "a b", "a//b", "a/"):
        with raising(UsageError, naming=repr(wrong)):
            node.resolve(wrong)


@check
def a_remapping_reaches_the_graph(site: Site) -> None:
    """Check that messages of a remapped topic arrive under its new name."""
    speaker, listener = site.node("speaker", remaps={"out": "line"}), site.node("listener")
    received: list[str] = []
    listener.subscribe("line", STRING, lambda one: received.append(one.data))
    publisher = speaker.advertise("out", STRING)
    demand(publisher.topic == f"{site.space}/line", f"its topic is {publisher.topic}")
    site.until(speaker, publisher.subscribers, "it connects")
    publisher.publish(new(STRING, data="x"))
    site.spin_until(listener, lambda: received, "the message arrives")


@check
def a_name_is_taken(site: Site) -> None:
    """Check that a taken name is a ``UsageError`` naming it, and that anonymous names differ."""
    first = site.node("node")
    with raising(UsageError, naming=first.name):
        site.node("node")
    demand(not first.closed, "the first node was thrown out")
    one, two = site.node("some", anonymous=True), site.node("some", anonymous=True)
    demand(one.name != two.name and "some_" in one.name, f"anonymous nodes are {one.name} and {two.name}")
    with raising(UsageError, naming="no valid ROS node name"):
        site.node("a/b")


@check
def the_graph_shows_who_is_there(site: Site) -> None:
    """Check that nodes, topics with types and users, and services appear, and leave with their node."""
    one, two = site.node("one"), site.node("two")
    topic = one.advertise("chat", STRING).topic
    two.subscribe("chat", STRING, lambda message: None)
    served = one.serve("ping", TRIGGER, lambda asked: service(TRIGGER).response()).name

    def seen() -> bool:
        names = site.graph.node_names()
        topics = {state.name: state for state in site.graph.topics()}
        services = {state.name: state for state in site.graph.services()}
        state = topics.get(topic)
        return (
            {one.name, two.name} <= set(names)
            and state is not None
            and (state.type, state.publishers, state.subscribers) == (STRING, (one.name,), (two.name,))
            and served in services
            and services[served].server == one.name
        )

    site.until(one, seen, "nodes, topic and service are seen as they are")
    one.close()
    site.until(
        two,
        lambda: (
            one.name not in site.graph.node_names()
            and served not in {state.name for state in site.graph.services()}
        ),
        "a node that has left is seen no more",
    )


@check
def a_closed_node_says_so(site: Site) -> None:
    """Check that calls of a closed node are a ``UsageError`` that says so, except ``close``."""
    node = site.node("node")
    publisher = node.advertise("chat", STRING)
    node.close()
    node.close()
    demand(node.closed, "it does not say that it is closed")
    asked = (
        lambda: node.advertise("x", STRING),
        lambda: node.subscribe("x", STRING, print),
        lambda: node.serve("x", TRIGGER, print),
        lambda: node.client("x", TRIGGER),
        lambda: node.timer(MS, lambda: None),
    )
    for one in asked:
        with raising(UsageError, naming="has left the graph"):
            one()
    with raising(UsageError, naming=node.name):
        publisher.publish(new(STRING))
    again = site.node("node")
    demand(again.name == node.name, "its name cannot be used again")


@check
def spinning_ends_with_the_node(site: Site) -> None:
    """Check that ``spin`` returns when the node is closed."""
    node, other = site.node("node"), site.node("other")
    ended: list[bool] = []

    def spin() -> None:
        node.spin()
        ended.append(True)

    site.kernel.spawn(spin, "spins", node.context)
    other.sleep(50 * MS)
    demand(not ended, "spin returned before the end")
    node.close()
    site.until(other, lambda: ended, "spin returns")


@check
def spin_once_waits_no_longer(site: Site) -> None:
    """Check that ``spin_once`` without callbacks returns False after its time; 0 does not wait."""
    node = site.node("node")
    demand(not node.spin_once(0), "there was work at once")
    start = node.now()
    demand(not node.spin_once(100 * MS), "there was work")
    demand(node.now() - start >= 100 * MS, "it did not wait")


@check
def a_callback_that_raises(site: Site) -> None:
    """Check that an exception of a callback is raised by ``spin_once``, and the next message arrives."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[str] = []

    def take(message: object) -> None:
        received.append(message.data)  # type: ignore[attr-defined]
        if len(received) == 1:
            raise ValueError("first")

    listener.subscribe("chat", STRING, take)
    publisher = speaker.advertise("chat", STRING)
    site.until(speaker, publisher.subscribers, "it connects")
    publisher.publish(new(STRING, data="a"))
    publisher.publish(new(STRING, data="b"))
    raised = ""
    try:
        site.spin_until(listener, lambda: len(received) == 1, "the first arrives")
    except ValueError as error:
        raised = str(error)
    demand(raised == "first", "it did not come out of spin_once")
    site.spin_until(listener, lambda: received == ["a", "b"], f"the second arrives, received {received}")


@check
def groups_are_spun_apart(site: Site) -> None:
    """Check that a callback of another group waits for that group; with ``start`` it does not wait."""
    speaker, listener = site.node("speaker"), site.node("listener")
    received: list[str] = []
    started: list[Work] = []
    apart, eager = listener.group(), listener.group(started.append)
    listener.subscribe("chat", STRING, lambda one: received.append("own"))
    listener.subscribe("chat", STRING, lambda one: received.append("apart"), group=apart)
    listener.subscribe("chat", STRING, lambda one: received.append("eager"), group=eager)
    publisher = speaker.advertise("chat", STRING)
    site.until(speaker, publisher.subscribers, "it connects")
    speaker.sleep(200 * MS)
    publisher.publish(new(STRING))
    site.until(speaker, lambda: started, "the eager group is started")
    demand(listener.spin_once(LIMIT) and received == ["own"], f"its own group ran {received}")
    demand(apart.spin_once(LIMIT) and received == ["own", "apart"], f"the other group ran {received}")
    started[0].run()
    demand(received == ["own", "apart", "eager"], f"the eager work ran {received}")
    with raising(UsageError, naming="another node"):
        speaker.subscribe("chat", STRING, lambda one: None, group=apart)


@check
def time_goes_on(site: Site) -> None:
    """Check that ROS time is the sum of the graph's epoch and the kernel's time, and never goes back."""
    node = site.node("node")
    before = site.graph.epoch + site.kernel.now()
    now = node.now()
    after = site.graph.epoch + site.kernel.now()
    demand(before <= now <= after, f"{now} is not between {before} and {after}")


SET_BOOL = "std_srvs/srv/SetBool"


def answered(success: bool, text: str = "") -> Any:
    """Return a response of SetBool."""
    return service(SET_BOOL).response(success=success, message=text)


@check
def a_service_answers(site: Site) -> None:
    """Check that a call returns what the handler returned for its request."""
    server, caller = site.spinning(site.node("server")), site.node("caller")
    server.serve("switch", SET_BOOL, lambda asked: answered(asked.data, f"was {asked.data}"))
    client = caller.client("switch", SET_BOOL)
    demand(client.wait(LIMIT), "the service is not found")
    demand(caller.wait_for_service("switch", LIMIT), "wait_for_service does not find it")
    demand(client.ready(), "it was found but is not ready")
    for value in (True, False):
        answer = client.call(request(SET_BOOL, data=value), LIMIT)
        demand(answer == answered(value, f"was {value}"), f"answered {answer}")


@check
def a_node_serves_itself(site: Site) -> None:
    """Check that a node that another task spins can call its own service."""
    node = site.spinning(site.node("node"))
    node.serve("~switch", SET_BOOL, lambda asked: answered(True))
    client = node.client("~switch", SET_BOOL)
    demand(client.wait(LIMIT), "the service is not found")
    demand(client.call(request(SET_BOOL), LIMIT).success, "no answer")


@check
def an_unserved_service(site: Site) -> None:
    """Check that calling an unserved service is a ``ServiceError`` at once, and waiting ends in time."""
    caller = site.node("caller")
    client = caller.client("nowhere", TRIGGER)
    with raising(ServiceError, naming="nowhere"):
        client.call(request(TRIGGER), 5 * S)
    demand(not client.ready(), "it is said to be ready")
    demand(not client.wait(100 * MS), "waiting says it is there")
    demand(not caller.wait_for_service("nowhere", 100 * MS), "wait_for_service says it is there")


@check
def a_handler_that_raises(site: Site) -> None:
    """Check that an exception of a handler is raised by its spin, and the caller gets a ``ServiceError``."""
    server, caller = site.node("server"), site.node("caller")

    def handle(asked: Any) -> Any:
        raise ValueError("no such thing")

    server.serve("broken", TRIGGER, handle)
    raised: list[str] = []

    def spin() -> None:
        try:
            server.spin()
        except ValueError as error:
            raised.append(str(error))

    site.kernel.spawn(spin, "spins the server", ExecutionContext(server.name))
    client = caller.client("broken", TRIGGER)
    demand(client.wait(LIMIT), "the service is not found")
    with raising(ServiceError, naming="broken") as caught:
        client.call(request(TRIGGER), S)
    if site.traits.reports_failure:
        demand("no such thing" in caught.text, f"the caller gets no reason: {caught.text}")
    site.until(caller, lambda: raised == ["no such thing"], "the error comes out of spin")


@check
def a_handler_that_returns_nonsense(site: Site) -> None:
    """Check that a handler that returns no response is a ``UsageError`` of its node, naming the service."""
    server, caller = site.node("server"), site.node("caller")
    server.serve("odd", TRIGGER, lambda asked: "yes")
    raised: list[str] = []

    def spin() -> None:
        try:
            server.spin()
        except UsageError as error:
            raised.append(str(error))

    site.kernel.spawn(spin, "spins the server", ExecutionContext(server.name))
    client = caller.client("odd", TRIGGER)
    demand(client.wait(LIMIT), "the service is not found")
    with raising(ServiceError, naming="odd"):
        client.call(request(TRIGGER), S)
    site.until(caller, lambda: raised and "odd" in raised[0], "the error comes out of spin")


@check
def no_answer_in_time(site: Site) -> None:
    """Check that a call to a server that does not spin is a ``ServiceError`` after its time."""
    server, caller = site.node("server"), site.node("caller")
    server.serve("slow", TRIGGER, lambda asked: service(TRIGGER).response(success=True))
    client = caller.client("slow", TRIGGER)
    demand(client.wait(LIMIT), "the service is not found")
    with raising(ServiceError, naming="no answer within"):
        client.call(request(TRIGGER), 200 * MS)
    site.spinning(server)
    demand(client.call(request(TRIGGER), LIMIT).success, "it does not answer the next call")


@check
def a_server_that_leaves(site: Site) -> None:
    """Check that a call whose server closes is a ``ServiceError``, and the service is not ready then."""
    server, caller = site.node("server"), site.node("caller")
    served = server.serve("leaving", TRIGGER, lambda asked: service(TRIGGER).response())
    client = caller.client("leaving", TRIGGER)
    demand(client.wait(LIMIT), "the service is not found")

    def leave() -> None:
        server.sleep(200 * MS)
        served.close()

    site.kernel.spawn(leave, "leaves", ExecutionContext(server.name))
    with raising(ServiceError, naming="leaving"):
        client.call(request(TRIGGER), 3 * S)
    site.until(caller, lambda: not client.ready(), "the service is not ready any more")


@check
def a_service_is_served_once(site: Site) -> None:
    """Check that serving a service of another node is a ``UsageError`` that names the node."""
    one, two = site.node("one"), site.node("two")
    one.serve("switch", TRIGGER, lambda asked: service(TRIGGER).response())
    demand(two.wait_for_service("switch", LIMIT), "the service is not found")
    with raising(UsageError, naming=one.name):
        two.serve("switch", TRIGGER, lambda asked: service(TRIGGER).response())


@check
def a_request_of_another_type(site: Site) -> None:
    """Check that a request of another type is a ``UsageError``, and an unknown service type, too."""
    node = site.node("node")
    client = node.client("switch", SET_BOOL)
    with raising(UsageError, naming="SetBool"):
        client.call(new("std_msgs/msg/Bool"))
    with raising(UsageError, naming="SetBol"):
        node.client("switch", "std_srvs/srv/SetBol")


@check
def parameters_of_a_node(site: Site) -> None:
    """Check that private parameters are set, read, found, replaced and removed."""
    node = site.node("node")
    values: dict[str, Any] = {"flag": True, "count": 3, "gain": 0.5, "text": "ü", "list": [1.5, 2.5]}
    for name, value in values.items():
        node.set_parameter(f"~{name}", value)
    for name, value in values.items():
        read = node.get_parameter(f"~{name}")
        demand(read == value and type(read) is type(value), f"{name} is {read!r}, not {value!r}")
    node.set_parameter("~count", 4)
    demand(node.get_parameter(f"{node.name}/count") == 4, "the absolute name reads something else")
    demand(node.has_parameter("~count"), "it is there, but is not found")
    node.delete_parameter("~count")
    demand(not node.has_parameter("~count"), "it was removed, but is found")


@check
def a_namespace_of_parameters(site: Site) -> None:
    """Check that a ``dict`` sets and reads a namespace of parameters."""
    node = site.node("node")
    node.set_parameter("~gains", {"p": 1.5, "roll": {"d": 0.25}})
    demand(node.get_parameter("~gains/roll/d") == 0.25, "a value below is not found")
    node.set_parameter("~gains/p", 2.5)
    read = node.get_parameter("~gains")
    demand(read == {"p": 2.5, "roll": {"d": 0.25}}, f"the namespace reads {read}")
    node.delete_parameter("~gains")
    demand(not node.has_parameter("~gains/p"), "it was removed, but is found")


@check
def a_parameter_that_is_not_there(site: Site) -> None:
    """Check that a missing parameter is a ``UsageError`` naming it, unless a default is given, even None."""
    node = site.node("node")
    with raising(UsageError, naming="nothing"):
        node.get_parameter("~nothing")
    with raising(UsageError, naming="nothing"):
        node.delete_parameter("~nothing")
    demand(node.get_parameter("~nothing", 7) == 7, "the default is not taken")
    demand(node.get_parameter("~nothing", None) is None, "the default None is not taken")


@check
def a_parameter_of_another_node(site: Site) -> None:
    """Check that a node reads and sets another node's parameters by their absolute names."""
    one, two = site.spinning(site.node("one")), site.node("two")
    one.set_parameter("~rate", 10)
    site.until(two, lambda: two.get_parameter(f"{one.name}/rate", 0) == 10, "the other node reads it")
    two.set_parameter(f"{one.name}/rate", 20)
    demand(one.get_parameter("~rate") == 20, "what the other node has set is not read")


@check
def a_parameter_outside_of_nodes(site: Site) -> None:
    """Check that relative parameters are shared by a namespace (in ROS 2: a ``UsageError`` that says why)."""
    one, two = site.node("one"), site.node("two")
    if not site.traits.global_parameters:
        with raising(UsageError, naming="belong to nodes"):
            one.set_parameter("shared", 1)
        return
    one.set_parameter("shared", 1)
    demand(two.get_parameter(f"{site.space}/shared") == 1, "another node does not read it")
    one.delete_parameter("shared")


@check
def a_timer_fires(site: Site) -> None:
    """Check that a timer calls back every period, not at once, and not after ``cancel``."""
    node = site.node("node")
    ticks: list[int] = []
    start = node.now()
    timer = node.timer(100 * MS, lambda: ticks.append(node.now() - start))
    site.spin_until(node, lambda: len(ticks) == 3, "it fires three times")
    demand(ticks[0] >= 100 * MS and ticks[2] >= 300 * MS, f"it fired at {ticks} ns")
    timer.cancel()
    site.listen(node)
    demand(len(ticks) == 3, "it fired after it was cancelled")


@check
def a_rate_keeps_a_loop(site: Site) -> None:
    """Check that a loop with a rate takes its period per turn, and ``sleep`` its duration."""
    node = site.node("node")
    rate = node.rate(50 * MS)
    start = node.now()
    for _ in range(4):
        rate.sleep()
    demand(node.now() - start >= 200 * MS, "four periods were over too soon")
    start = node.now()
    node.sleep(100 * MS)
    demand(node.now() - start >= 100 * MS, "sleep was over too soon")
