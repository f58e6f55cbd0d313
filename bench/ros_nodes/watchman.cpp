// Answers each attitude that it hears with whether it is safe; has no loop of its own.
#include <cmath>

#include <ros/ros.h>
#include <std_msgs/Bool.h>
#include <std_msgs/Float64MultiArray.h>

namespace {
ros::Publisher verdicts;

void onAttitude(const std_msgs::Float64MultiArray::ConstPtr& message) {
  std_msgs::Bool safe;
  safe.data = std::fabs(message->data[0]) < 0.5 && std::fabs(message->data[1]) < 0.5;
  verdicts.publish(safe);
}
}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "watchman");
  ros::NodeHandle node;
  verdicts = node.advertise<std_msgs::Bool>("safe", 10);
  ros::Subscriber attitudes = node.subscribe("attitude", 10, onAttitude);
  ros::spin();
  return 0;
}
