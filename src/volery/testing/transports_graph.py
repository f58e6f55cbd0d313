"""What names, nodes and groups must do on any graph."""

from __future__ import annotations

from volery.base.errors import UsageError
from volery.base.time import MS
from volery.ros.graph.interface import Work
from volery.ros.messages import new, service
from volery.testing.checks import demand, raising
from volery.testing.transports_site import LIMIT, Site, check

STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"


@check
def names_resolve(site: Site) -> None:
    """Relative, private, absolute and remapped names become what ROS says."""
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
    """What is remapped in one node is heard where it was remapped to."""
    speaker, listener = site.node("speaker", remaps={"out": "line"}), site.node("listener")
    heard: list[str] = []
    listener.subscribe("line", STRING, lambda one: heard.append(one.data))
    publisher = speaker.advertise("out", STRING)
    demand(publisher.topic == f"{site.space}/line", f"its topic is {publisher.topic}")
    site.until(speaker, publisher.subscribers, "it connects")
    publisher.publish(new(STRING, data="x"))
    site.spin_until(listener, lambda: heard, "the message arrives")


@check
def a_name_is_taken(site: Site) -> None:
    """A second node of a name is a ``UsageError`` that names it; the first goes on; anonymous ones differ."""
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
    """Nodes, topics with their types and users, and services appear, and go when their node does."""
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
    """Whatever is asked of a node that has left is a ``UsageError`` that says so; closing twice is fine."""
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
    """Who spins a node returns when it is closed."""
    node, other = site.node("node"), site.node("other")
    ended: list[bool] = []

    def spin() -> None:
        node.spin()
        ended.append(True)

    site.kernel.spawn(spin, "spins", node.place)
    other.sleep(50 * MS)
    demand(not ended, "spin returned before the end")
    node.close()
    site.until(other, lambda: ended, "spin returns")


@check
def spin_once_waits_no_longer(site: Site) -> None:
    """Without work ``spin_once`` says so when its time is over; 0 does not wait at all."""
    node = site.node("node")
    demand(not node.spin_once(0), "there was work at once")
    start = node.now()
    demand(not node.spin_once(100 * MS), "there was work")
    demand(node.now() - start >= 100 * MS, "it did not wait")


@check
def a_callback_that_raises(site: Site) -> None:
    """What a callback raises comes out of ``spin_once``; the next message is heard."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []

    def take(message: object) -> None:
        heard.append(message.data)  # type: ignore[attr-defined]
        if len(heard) == 1:
            raise ValueError("first")

    listener.subscribe("chat", STRING, take)
    publisher = speaker.advertise("chat", STRING)
    site.until(speaker, publisher.subscribers, "it connects")
    publisher.publish(new(STRING, data="a"))
    publisher.publish(new(STRING, data="b"))
    raised = ""
    try:
        site.spin_until(listener, lambda: len(heard) == 1, "the first arrives")
    except ValueError as error:
        raised = str(error)
    demand(raised == "first", "it did not come out of spin_once")
    site.spin_until(listener, lambda: heard == ["a", "b"], f"the second arrives, heard {heard}")


@check
def groups_are_spun_apart(site: Site) -> None:
    """A callback of another group waits for that group; one with ``start`` waits for nobody."""
    speaker, listener = site.node("speaker"), site.node("listener")
    heard: list[str] = []
    started: list[Work] = []
    apart, eager = listener.group(), listener.group(started.append)
    listener.subscribe("chat", STRING, lambda one: heard.append("own"))
    listener.subscribe("chat", STRING, lambda one: heard.append("apart"), group=apart)
    listener.subscribe("chat", STRING, lambda one: heard.append("eager"), group=eager)
    publisher = speaker.advertise("chat", STRING)
    site.until(speaker, publisher.subscribers, "it connects")
    speaker.sleep(200 * MS)
    publisher.publish(new(STRING))
    site.until(speaker, lambda: started, "the eager group is told")
    demand(listener.spin_once(LIMIT) and heard == ["own"], f"its own group ran {heard}")
    demand(apart.spin_once(LIMIT) and heard == ["own", "apart"], f"the other group ran {heard}")
    started[0].run()
    demand(heard == ["own", "apart", "eager"], f"the eager work ran {heard}")
    with raising(UsageError, naming="another node"):
        speaker.subscribe("chat", STRING, lambda one: None, group=apart)


@check
def time_goes_on(site: Site) -> None:
    """ROS time is the graph's epoch and the kernel's time; it does not go back."""
    node = site.node("node")
    before = site.graph.epoch + site.kernel.now()
    now = node.now()
    after = site.graph.epoch + site.kernel.now()
    demand(before <= now <= after, f"{now} is not between {before} and {after}")
