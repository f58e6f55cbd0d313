#!/usr/bin/env python3
"""What the wiki's tutorial on parameters does: global, relative and private ones, groups, search."""

import rospy
from std_msgs.msg import String

rospy.init_node("parameters")
told = rospy.Publisher("told", String, queue_size=100)
while told.get_num_connections() < rospy.get_param("~listeners"):
    rospy.sleep(0.05)


def tell(what, value):
    rospy.loginfo("%s is %s", rospy.resolve_name(what), value)
    told.publish(f"{what}: {value}")


tell("~rate", rospy.get_param("~rate"))
tell("~unset", rospy.get_param("~unset", "its default"))
try:
    rospy.get_param("~unset")
except KeyError:
    tell("~unset", "missing")
rospy.set_param("/a_global", 3)
rospy.set_param("relative", [1, 2.5, "three"])
rospy.set_param("~flag", False)
rospy.set_param("gains", {"p": 1, "i": 2, "d": {"limit": 0.5}})
for name in ("/a_global", "relative", "~flag", "gains", "gains/d/limit"):
    tell(name, rospy.get_param(name))
tell("gains/x", rospy.has_param("gains/x"))
tell("gains/p", rospy.has_param("gains/p"))
tell("gains", rospy.search_param("gains"))
tell("nothing", rospy.search_param("nothing"))
rospy.delete_param("gains/p")
tell("gains", rospy.get_param("gains"))
try:
    rospy.delete_param("gains/p")
except KeyError:
    tell("gains/p", "gone already")
tell("names", [name for name in sorted(rospy.get_param_names()) if "gains" in name])
