"""The sizes of this machine's queues, with the real compiler; which sizes they are depends on the machine."""

from volery.calibration.queue_measurement import ASSUMED_WINDOW, WINDOW, measure_queues, steps_of


def test_every_size_found_is_one_that_was_tried():
    found = measure_queues()
    assert all(size in steps_of(kind) for kind, size in found.found.items())
    assert found.window in (*steps_of(WINDOW), ASSUMED_WINDOW)
    groups = [pipes for queue in found.issue_queues() for pipes in queue.pipes]
    assert len(groups) == len(set(groups))
