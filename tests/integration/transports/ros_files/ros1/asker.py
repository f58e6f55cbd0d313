#!/usr/bin/env python3
"""Has numbers added before it is a node, and tells the answers once it is one, in a type of its own."""

import rospy
from std_msgs.msg import Int64
from tutorial_msgs.msg import Person
from tutorial_msgs.srv import AddTwoInts, AddTwoIntsRequest

rospy.wait_for_service("add_two_ints")
proxy = rospy.ServiceProxy("add_two_ints", AddTwoInts)
answers = [proxy(1, 2).sum, proxy(a=-5, b=2).sum, proxy.call(AddTwoIntsRequest(2**40, 1)).sum]
try:
    proxy(4, 4)
except rospy.ServiceException as error:
    answers.append(-1 if "4 twice" in str(error) else 0)

rospy.init_node("asker", anonymous=True)
sums = rospy.Publisher("sums", Int64, queue_size=10)
people = rospy.Publisher("people", Person, latch=True, queue_size=1)
while sums.get_num_connections() < rospy.get_param("~listeners"):
    rospy.sleep(0.05)
for answer in answers:
    sums.publish(answer)
person = Person(name="Ada", age=36)
person.header.frame_id = "house"
person.scores = [0.5, answers[0]]
people.publish(person)
rospy.spin()
