from typing import Any

import pytest

from volery.base.errors import UsageError
from volery.base.time import MS, S
from volery.ros import messages
from volery.ros.graph import ServiceError
from volery.trace.events import Call

SET_BOOL = "std_srvs/srv/SetBool"


def asked(value: bool) -> Any:
    return messages.request(SET_BOOL, data=value)


def answer(**fields: Any) -> Any:
    return messages.service(SET_BOOL).response(**fields)


def server_of(rig: Any, handler: Any, requests: int = 1) -> Any:
    def server() -> None:
        node = rig.graph.node("server")
        node.serve("switch", SET_BOOL, handler)
        for _ in range(requests):
            node.spin_once()

    return server


def test_a_call_blocks_until_the_server_has_answered(rig: Any) -> None:
    rig.delay = 5 * MS

    def handler(request: Any) -> Any:
        rig.kernel.sleep_until(rig.kernel.now() + 100 * MS)
        return answer(success=request.data, message="done")

    def client() -> None:
        switch = rig.graph.node("client").client("switch", SET_BOOL)
        assert switch.wait()
        assert switch.call(asked(True)) == answer(success=True, message="done")
        assert rig.kernel.now() == 110 * MS

    rig.run(server_of(rig, handler), client)
    assert rig.of(Call) == [Call(0, 110 * MS, "client", "server", "/switch", "ok")]


def test_the_handler_gets_a_copy(rig: Any) -> None:
    given: list[Any] = []

    def handler(request: Any) -> Any:
        given.append(request)
        request.data = False
        return answer()

    def client() -> None:
        request = asked(True)
        rig.graph.node("client").client("switch", SET_BOOL).call(request)
        assert request.data

    rig.run(server_of(rig, handler), client)
    assert len(given) == 1


def test_an_unserved_service(rig: Any) -> None:
    def client() -> None:
        node = rig.graph.node("client")
        node.serve("switch", SET_BOOL, lambda request: answer())
        with pytest.raises(ServiceError, match=r"/swich: no node serves it.*did you mean '/switch'"):
            node.client("swich", SET_BOOL).call(asked(True))

    rig.run(client)


def test_no_answer_in_time(rig: Any) -> None:
    def client() -> None:
        node = rig.graph.node("client")
        node.serve("switch", SET_BOOL, lambda request: answer())  # nobody spins
        with pytest.raises(ServiceError, match=r"/switch: no answer within 0\.5 s"):
            node.client("switch", SET_BOOL).call(asked(True), within=500 * MS)
        assert rig.kernel.now() == 500 * MS

    rig.run(client)
    assert [event.outcome for event in rig.of(Call)] == ["ServiceError"]


def test_an_exception_of_a_handler_reaches_the_caller_and_the_server(rig: Any) -> None:
    def handler(request: Any) -> Any:
        raise RuntimeError("jammed")

    def server() -> None:
        node = rig.graph.node("server")
        node.serve("switch", SET_BOOL, handler)
        with pytest.raises(RuntimeError, match="jammed"):
            node.spin_once()

    def client() -> None:
        with pytest.raises(ServiceError, match=r"/switch: its handler raised RuntimeError: jammed"):
            rig.graph.node("client").client("switch", SET_BOOL).call(asked(True))

    rig.run(server, client)


def test_a_handler_must_return_a_response(rig: Any) -> None:
    def server() -> None:
        node = rig.graph.node("server")
        node.serve("switch", SET_BOOL, lambda request: True)
        with pytest.raises(UsageError, match=r"handler of /switch returned True"):
            node.spin_once()

    def client() -> None:
        with pytest.raises(ServiceError, match="not a std_srvs/srv/SetBool response"):
            rig.graph.node("client").client("switch", SET_BOOL).call(asked(True))

    rig.run(server, client)


def test_a_server_that_leaves_before_it_has_answered(rig: Any) -> None:
    def server() -> None:
        node = rig.graph.node("server")
        node.serve("switch", SET_BOOL, lambda request: answer())
        node.sleep(S)
        node.close()

    def client() -> None:
        with pytest.raises(ServiceError, match="its server has gone"):
            rig.graph.node("client").client("switch", SET_BOOL).call(asked(True))
        assert rig.kernel.now() == S

    rig.run(server, client)


def test_types_must_agree(rig: Any) -> None:
    def client() -> None:
        node = rig.graph.node("client")
        node.serve("switch", SET_BOOL, lambda request: answer())
        with pytest.raises(
            ServiceError, match=r"/client serves it as std_srvs/srv/SetBool, not std_srvs/srv/Trigger"
        ):
            node.client("switch", "std_srvs/Trigger").call(messages.request("std_srvs/Trigger"))
        with pytest.raises(UsageError, match=r"takes a std_srvs/srv/SetBool_Request"):
            node.client("switch", SET_BOOL).call(messages.request("std_srvs/Trigger"))

    rig.run(client)


def test_one_name_has_one_server(rig: Any) -> None:
    def server() -> None:
        node = rig.graph.node("server")
        service = node.serve("switch", SET_BOOL, lambda request: answer())
        with pytest.raises(UsageError, match=r"/switch is served by /server already"):
            node.serve("switch", SET_BOOL, lambda request: answer())
        service.close()
        node.serve("switch", SET_BOOL, lambda request: answer())

    rig.run(server)


def test_waiting_for_a_service(rig: Any) -> None:
    def client() -> None:
        node = rig.graph.node("client")
        switch = node.client("switch", SET_BOOL)
        assert not switch.ready()
        assert not switch.wait(within=S)
        assert switch.wait()
        assert node.wait_for_service("switch")
        assert rig.kernel.now() == 2 * S

    def server() -> None:
        node = rig.graph.node("server")
        node.sleep(2 * S)
        node.serve("switch", SET_BOOL, lambda request: answer())

    rig.run(client, server)
