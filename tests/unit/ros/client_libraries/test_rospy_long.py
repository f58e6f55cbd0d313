"""Long arrays in rospy: each subscriber's message is its own, as there."""

from __future__ import annotations

from typing import Any

from volery.base.time import S
from volery.ros import messages

TALKER = """
import numpy as np
from sensor_msgs.msg import Image, LaserScan
rospy.init_node("talker")
images = rospy.Publisher("image", Image, queue_size=10)
scans = rospy.Publisher("scan", LaserScan, queue_size=10, latch=True)
rospy.sleep(0.1)
for count in range(3):
    ranges = [float(count)] * 1080
    images.publish(Image(data=bytes([count]) * 6000, encoding="mono8"))
    scans.publish(LaserScan(ranges=ranges))
    ranges[0] = 99.0
    rospy.sleep(0.1)
rospy.sleep(5)
"""


def test_messages_that_a_callback_keeps_stay_as_they_were(stage: Any) -> None:
    stage.modules |= messages.modules(library="rospy")
    stage.component(
        "listener",
        """
import copy
import numpy as np
from sensor_msgs.msg import Image, LaserScan
rospy.init_node("listener")
kept = []
rospy.Subscriber("image", Image, kept.append)
rospy.Subscriber("scan", LaserScan, kept.append)
rospy.sleep(1)
for one in kept:
    if isinstance(one, Image):
        try:
            np.frombuffer(one.data, np.uint8)[0] = 9
        except ValueError as error:
            out(str(error))
        again = copy.deepcopy(one), copy.copy(one)
        out((type(one.data), one.data == one.data[:1] * 6000, one.data[0], [each == one for each in again]))
    else:
        again = copy.deepcopy(one)
        out((type(one.ranges), len(one.ranges), one.ranges[0], again.ranges == one.ranges))
""",
    )
    stage.component("talker", TALKER)
    found = stage.run(3 * S)
    assert [one for one in found if isinstance(one, str)] == ["assignment destination is read-only"] * 3
    assert sorted(one[2] for one in found if one[0] is bytes) == [0, 1, 2]
    assert all(one[1] and one[3] == [True] * 2 for one in found if one[0] is bytes)
    assert sorted(one[2] for one in found if one[0] is tuple) == [0.0, 1.0, 2.0]
    assert all(one[1] == 1080 and one[3] for one in found if one[0] is tuple)


def test_a_list_of_rospy_that_is_replaced_is_not_that_of_others(stage: Any) -> None:
    stage.modules |= messages.modules(library="rospy")
    text = """
import numpy as np
from rospy.numpy_msg import numpy_msg
from sensor_msgs.msg import Image, LaserScan
rospy.init_node("{name}")
again = rospy.Publisher("again", LaserScan, queue_size=1)
def image(message):
    data = bytearray(message.data)
    data[0] = 77
    message.data = bytes(data)
def scan(message):
    message.ranges[:] = 7
    again.publish(message)
rospy.Subscriber("image", Image, image)
rospy.Subscriber("scan", numpy_msg(LaserScan), scan)
rospy.sleep(1)
"""
    stage.component("one", text.format(name="one"))
    stage.component("two", text.format(name="two"))
    stage.component(
        "listener",
        """
from sensor_msgs.msg import Image, LaserScan
rospy.init_node("listener")
rospy.Subscriber("image", Image, lambda message: out(message.data[0]))
rospy.Subscriber("scan", LaserScan, lambda message: out(message.ranges[0]))
rospy.Subscriber("again", LaserScan, lambda message: out(("again", message.ranges[1079])))
rospy.sleep(1)
rospy.Subscriber("scan", LaserScan, lambda message: out(("late", message.ranges[0])))
rospy.sleep(1)
""",
    )
    stage.component("talker", TALKER)
    found = stage.run(3 * S)
    assert sorted(one for one in found if isinstance(one, int)) == [0, 1, 2]
    assert sorted(one for one in found if isinstance(one, float)) == [0.0, 1.0, 2.0]
    assert found.count(("again", 7.0)) == 6
    assert ("late", 2.0) in found
