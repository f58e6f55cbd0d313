"""The diagram in text."""

from volery.model.diagram import diagram


def test_everything_is_in_it_once(workshop):
    lines = diagram(workshop.load("pocket", "fast")).splitlines()
    assert lines[0] == "hospital-delivery · allocation fast · scenario pocket"
    for line in (
        "ground: intel-i5-3470 at 3000 MHz × 4, fixed-priority",
        "  ├ central: DeliveryCentral (python)",
        "  │    drones → control.service  [DroneService]",
        "onboard: rpi4-cortex-a72 at 1500 MHz × 4, fixed-priority, carried by drone_1",
        "  ├ control: drone_control (rospy, each 100 ms, priority 12)",
        "  │    drone → drone_1  [Drone]",
        "  └ node of drone_1",
        "  ├ requester: Requester (python, active, priority 0)",
        "  ├ radio: ground — onboard, 57600 bit/s, 20 ms, 0.50% lost",
        "  ├ rover_1: rover, ardupilot, rtk, at store (0 m east, 0 m north)",
    ):
        assert lines.count(line) == 1, line
