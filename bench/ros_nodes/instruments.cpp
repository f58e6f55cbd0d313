// Fifty times a second: publish the readings of several instruments, each on a topic of its own.
#include <string>
#include <vector>

#include <ros/ros.h>
#include <std_msgs/Float64MultiArray.h>

int main(int argc, char** argv) {
  ros::init(argc, argv, "instruments");
  ros::NodeHandle node("~");
  int topics = 0;
  node.getParam("topics", topics);
  std::vector<ros::Publisher> readings;
  for (int number = 0; number < topics; ++number)
    readings.push_back(node.advertise<std_msgs::Float64MultiArray>("reading_" + std::to_string(number), 10));
  ros::Rate rate(50);
  std_msgs::Float64MultiArray reading;
  reading.data.resize(4);
  for (double taken = 0.0; ros::ok(); ++taken) {
    reading.data.assign(4, taken);
    for (ros::Publisher& publisher : readings) publisher.publish(reading);
    rate.sleep();
  }
  return 0;
}
