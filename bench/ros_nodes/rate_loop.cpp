// Fifty times a second: follow the latest set-point, publish motor commands.
#include <ros/ros.h>
#include <std_msgs/Float64MultiArray.h>

namespace {
double wanted = 0.0;

void onSetpoint(const std_msgs::Float64MultiArray::ConstPtr& message) { wanted = message->data[0]; }
}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "rate_loop");
  ros::NodeHandle node;
  ros::Subscriber setpoints = node.subscribe("setpoint", 1, onSetpoint);
  ros::Publisher motors = node.advertise<std_msgs::Float64MultiArray>("motors", 10);
  ros::Rate rate(50);
  std_msgs::Float64MultiArray turning;
  turning.data.resize(4);
  double actual = 0.0;
  while (ros::ok()) {
    actual += 0.02 * (wanted - actual);
    for (int motor = 0; motor < 4; ++motor) turning.data[motor] = actual;
    motors.publish(turning);
    ros::spinOnce();
    rate.sleep();
  }
  return 0;
}
