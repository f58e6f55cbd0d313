// What the pose keeper moves: it integrates cmd_vel and says where it is. Its messages: roscpp's, and one of its own.
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/Twist.h>
#include <robot_msgs/Mark.h>
#include <ros/ros.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_msgs/String.h>
#include <std_srvs/Empty.h>
#include <std_srvs/SetBool.h>

static geometry_msgs::Twist command;
static bool stopped = false;

void onCommand(const geometry_msgs::Twist& message) { command = message; }

bool stop(std_srvs::Empty::Request&, std_srvs::Empty::Response&) {
    stopped = true;
    return true;
}

int main(int argc, char** argv) {
    ros::init(argc, argv, "plant");
    ros::NodeHandle node;
    auto commands = node.subscribe("cmd_vel", 1, onCommand);
    auto poses = node.advertise<geometry_msgs::PoseWithCovarianceStamped>("poseupdate", 10);
    auto fixes = node.advertise<sensor_msgs::NavSatFix>("fix", 10);
    auto words = node.advertise<std_msgs::String>("words", 10, true);
    auto marks = node.advertise<robot_msgs::Mark>("marks", 10);
    auto stops = node.advertiseService("stop", stop);

    std_msgs::String word;
    word.data = "go on";
    words.publish(word);
    ros::Duration(0.1).sleep();
    std_srvs::SetBool enable;
    enable.request.data = true;
    ros::service::waitForService("enable");
    if (!ros::service::call("enable", enable)) return 1;
    ROS_INFO_STREAM("enabled: " << enable.response.message);

    geometry_msgs::PoseWithCovarianceStamped pose;
    pose.header.frame_id = "map";
    sensor_msgs::NavSatFix fix;
    fix.latitude = 43.5;
    fix.status.status = sensor_msgs::NavSatStatus::STATUS_NO_FIX;
    ros::Rate rate(10);
    int round = 0;
    while (ros::ok() && !stopped) {
        pose.header.stamp = ros::Time::now();
        pose.pose.pose.position.x += 0.1 * command.linear.x;
        pose.pose.pose.position.y += 0.1 * command.linear.y;
        poses.publish(pose);
        fixes.publish(fix);
        robot_msgs::Mark mark;
        mark.numbers = {std::int16_t(round), -1};
        mark.kind = robot_msgs::Mark::ROUND;
        marks.publish(mark);
        ++round;
        ros::spinOnce();
        rate.sleep();
    }
    ROS_INFO("stopped after %d rounds", round);
    return 0;
}
