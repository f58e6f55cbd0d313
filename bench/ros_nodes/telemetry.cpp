// Publish the attitude at 20 Hz and the battery at 2 Hz; subscribe to nothing.
#include <cmath>

#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>

int main(int argc, char** argv) {
  ros::init(argc, argv, "telemetry");
  ros::NodeHandle node;
  ros::Publisher attitudes = node.advertise<std_msgs::Float64MultiArray>("attitude", 10);
  ros::Publisher batteries = node.advertise<std_msgs::Float64>("battery", 10);
  std_msgs::Float64MultiArray attitude;
  attitude.data.resize(3);
  std_msgs::Float64 battery;
  battery.data = 16.8;
  for (long cycle = 0; ros::ok(); ++cycle) {
    attitude.data[0] = 0.1 * std::sin(0.05 * cycle);
    attitude.data[1] = 0.1 * std::cos(0.05 * cycle);
    attitudes.publish(attitude);
    if (cycle % 10 == 0) {
      battery.data -= 0.001;
      batteries.publish(battery);
    }
    ros::Duration(0.05).sleep();
  }
  return 0;
}
