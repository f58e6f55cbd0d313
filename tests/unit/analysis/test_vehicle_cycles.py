import pytest

from volery.analysis.vehicle_cycles import cycle_of
from volery.base.errors import VoleryError
from volery.base.time import MS
from volery.bridge.naming_schemes import MAVROS_TOPICS


def test_topics_limit_the_messages_of_a_node():
    mavros = cycle_of("ardupilot", "")
    assert mavros == cycle_of("px4", "mavros")
    assert (mavros.period, mavros.messages) == (100 * MS, len(MAVROS_TOPICS))
    assert cycle_of("ardupilot", "roscopter").messages < mavros.messages
    assert cycle_of("paparazzi", "").messages == 200


def test_an_autopilot_that_is_a_node_itself_has_none():
    assert cycle_of("dji", "") is None
    with pytest.raises(VoleryError):
        cycle_of("px5", "")
