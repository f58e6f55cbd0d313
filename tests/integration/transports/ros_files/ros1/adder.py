#!/usr/bin/env python3
"""Adds two numbers, as the wiki's tutorial on services does."""

import rospy
from tutorial_msgs.srv import AddTwoInts, AddTwoIntsResponse


def add(request):
    if request.a == request.b:
        raise rospy.ServiceException(f"{request.a} twice")
    return AddTwoIntsResponse(request.a + request.b)


if __name__ == "__main__":
    rospy.init_node("adder")
    service = rospy.Service("add_two_ints", AddTwoInts, add)
    service.spin()
