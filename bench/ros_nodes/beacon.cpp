// Five times a second: here I am, to everybody who listens.
#include <ros/ros.h>
#include <std_msgs/String.h>

int main(int argc, char** argv) {
  ros::init(argc, argv, "beacon");
  ros::NodeHandle node;
  ros::Publisher heartbeats = node.advertise<std_msgs::String>("heartbeat", 10);
  ros::Rate rate(5);
  std_msgs::String heartbeat;
  heartbeat.data = "drone_1: flying";
  while (ros::ok()) {
    heartbeats.publish(heartbeat);
    rate.sleep();
  }
  return 0;
}
