// Ten times a second: hear where the drone is, say where it should go. The shape of controller that the paper measures.
#include <ros/ros.h>
#include <std_msgs/Float64MultiArray.h>

namespace {
const double goal[3] = {40.0, -25.0, 12.0};
double position[3] = {0.0, 0.0, 0.0};

void onPosition(const std_msgs::Float64MultiArray::ConstPtr& message) {
  for (int axis = 0; axis < 3; ++axis) position[axis] = message->data[axis];
}
}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "drone_controller");
  ros::NodeHandle node;
  ros::Subscriber positions = node.subscribe("position", 1, onPosition);
  ros::Publisher setpoints = node.advertise<std_msgs::Float64MultiArray>("setpoint", 10);
  ros::Rate rate(10);
  std_msgs::Float64MultiArray setpoint;
  setpoint.data.resize(3);
  while (ros::ok()) {
    for (int axis = 0; axis < 3; ++axis) setpoint.data[axis] = 0.8 * (goal[axis] - position[axis]);
    setpoints.publish(setpoint);
    ros::spinOnce();
    rate.sleep();
  }
  return 0;
}
