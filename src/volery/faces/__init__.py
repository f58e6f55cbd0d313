"""Import faces of client libraries (rospy) over the embedded graph."""
