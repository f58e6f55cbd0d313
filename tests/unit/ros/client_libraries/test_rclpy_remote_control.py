"""Access to an rclpy node by other nodes: log, parameters and lifecycle."""

from __future__ import annotations

from typing import Any

from volery.base.time import S


def test_the_log_is_a_topic_for_who_listens(stage: Any) -> None:
    stage.script(
        "station",
        """
        import rclpy
        from rcl_interfaces.msg import Log
        rclpy.init()
        node = rclpy.create_node("station", enable_rosout=False)
        node.create_subscription(Log, "/rosout", lambda m: out((m.level, m.name, m.msg, m.line)), 9)
        node.get_logger().info("hidden")
        rclpy.spin(node)
        """,
    )
    stage.script(
        "robot",
        """
        import rclpy
        from rclpy.logging import get_logger
        rclpy.init()
        node = rclpy.create_node("robot")
        rclpy.spin_once(node, timeout_sec=0.5)
        node.get_logger().warning("hot")
        node.get_logger().get_child("motor").log("hotter", 40)
        node.get_logger().debug("hidden")
        get_logger("apart").info("of no node")
        """,
    )
    assert stage.run(2 * S) == [(30, "robot", "hot", 7), (40, "robot.motor", "hotter", 8)]


def test_levels_of_loggers_go_by_name(stage: Any) -> None:
    stage.script(
        "node",
        """
        import rclpy
        from rclpy import logging
        rclpy.init()
        node = rclpy.create_node("node")
        logging.set_logger_level("node", logging.LoggingSeverity.DEBUG)
        out(node.get_logger().debug("shown now"))
        out(logging.get_logger_effective_level("node.part").name)
        out((logging.get_logger_level("other").name, logging.get_logging_severity_from_string("warn").name))
        """,
    )
    assert stage.run(S) == [True, "DEBUG", ("UNSET", "WARN")]


def test_a_lifecycle_led_from_within(stage: Any) -> None:
    stage.script(
        "watcher",
        """
        import rclpy
        from lifecycle_msgs.msg import TransitionEvent
        rclpy.init()
        node = rclpy.create_node("watcher")

        def receive(event):
            out((event.transition.label, event.start_state.label, event.goal_state.label))

        node.create_subscription(TransitionEvent, "/node/transition_event", receive, 10)
        rclpy.spin(node)
        """,
    )
    stage.script(
        "node",
        """
        import rclpy
        from rclpy.lifecycle import Node, SimpleManagedEntity, TransitionCallbackReturn

        class Arm(SimpleManagedEntity):
            @SimpleManagedEntity.when_enabled(when_not_enabled=lambda: out("rests"))
            def move(self):
                out("moves")

        class Robot(Node):
            def on_deactivate(self, state):
                return TransitionCallbackReturn.FAILURE

        rclpy.init()
        node, arm = Robot("node"), Arm()
        node.add_managed_entity(arm)
        arm.move()
        triggers = node.trigger_configure, node.trigger_activate, node.trigger_deactivate
        out([trigger().name for trigger in triggers])
        arm.move()
        try:
            node.trigger_cleanup()
        except RuntimeError as error:
            out(str(error))
        """,
    )
    lines = stage.run(S)
    assert [one for one in lines if not isinstance(one, tuple)] == [
        "rests",
        ["SUCCESS", "SUCCESS", "FAILURE"],
        "moves",
        "No transition matching cleanup found for current state active",
    ]
    assert [one for one in lines if isinstance(one, tuple)] == [
        ("configure", "unconfigured", "configuring"),
        ("transition_success", "configuring", "inactive"),
        ("activate", "inactive", "activating"),
        ("transition_success", "activating", "active"),
        ("deactivate", "active", "deactivating"),
        ("transition_failure", "deactivating", "active"),
    ]


def test_parameters_are_read_and_set_from_afar(stage: Any) -> None:
    stage.script(
        "node",
        """
        import rclpy
        from rcl_interfaces.msg import ParameterDescriptor
        rclpy.init()
        node = rclpy.create_node("node")
        node.declare_parameter("fixed", 3, ParameterDescriptor(read_only=True))
        node.declare_parameter("gains.p", 1.5)
        rclpy.spin(node)
        """,
    )
    stage.script(
        "station",
        """
        import rclpy
        from rcl_interfaces.srv import GetParameters, SetParametersAtomically
        from rclpy.parameter import Parameter
        rclpy.init()
        node = rclpy.create_node("station", start_parameter_services=False)

        def ask(kind, name, **fields):
            client = node.create_client(kind, f"node/{name}")
            client.wait_for_service()
            future = client.call_async(kind.Request(**fields))
            rclpy.spin_until_future_complete(node, future)
            return future.result()

        for value in (4, 3.5):
            wanted = [Parameter("gains.p", value=2.5), Parameter("fixed", value=value)]
            result = ask(SetParametersAtomically, "set_parameters_atomically",
                         parameters=[one.to_parameter_msg() for one in wanted]).result
            out((result.successful, result.reason))
        out(ask(GetParameters, "get_parameters", names=["gains.p"]).values[0].double_value)
        out([one for one, _ in node.get_service_names_and_types() if "station" in one])
        """,
    )
    refused = (False, "Trying to set a read-only parameter: fixed.")
    assert stage.run(S) == [refused, refused, 1.5, []]
