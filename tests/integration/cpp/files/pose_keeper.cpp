// A node as a student writes one: it keeps a pose by PID, from poseupdate to cmd_vel. It compiles with roscpp, too.
#include <boost/bind.hpp>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/Twist.h>
#include <ros/ros.h>
#include <sensor_msgs/NavSatFix.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_msgs/String.h>
#include <std_srvs/Empty.h>
#include <std_srvs/SetBool.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

class Pid {
public:
    Pid(double p, double i, double d) : p_(p), i_(i), d_(d) {}
    double step(double error, double dt) {
        sum_ += error * dt;
        double const slope = dt > 0.0 ? (error - last_) / dt : 0.0;
        last_ = error;
        return p_ * error + i_ * sum_ + d_ * slope;
    }

private:
    double p_, i_, d_, sum_ = 0.0, last_ = 0.0;
};

class PoseKeeper {
public:
    PoseKeeper(ros::NodeHandle& node, ros::NodeHandle& own) : x_(0.5, 0.0002, 0.00005), y_(x_) {
        own.param("goal_x", goal_x_, 1.0);
        own.param("goal_y", goal_y_, 2.0);
        own.param<std::string>("frame", frame_, "map");
        std::vector<double> tolerances;
        if (own.getParam("tolerances", tolerances) && !tolerances.empty()) tolerance_ = tolerances[0];
        commands_ = node.advertise<geometry_msgs::Twist>("cmd_vel", 1);
        errors_ = node.advertise<std_msgs::Float64MultiArray>("errors", 10, true);
        poses_ = node.subscribe("poseupdate", 10, &PoseKeeper::pose, this);
        fixes_ = node.subscribe<sensor_msgs::NavSatFix>("fix", 1, boost::bind(&PoseKeeper::fix, this, _1, "gps"));
        words_ = node.subscribe<std_msgs::String>(
            "words", 5, [this](const std_msgs::String::ConstPtr& word) { last_word_ = word->data; });
        enable_ = node.advertiseService("enable", &PoseKeeper::enable, this);
        timer_ = node.createTimer(ros::Duration(0.5), &PoseKeeper::report, this);
    }
    bool done() const { return done_; }

private:
    void pose(const geometry_msgs::PoseWithCovarianceStamped::ConstPtr& message) {
        if (!enabled_) return;
        double const dt = last_.isZero() ? 0.0 : (message->header.stamp - last_).toSec();
        last_ = message->header.stamp;
        double const ex = goal_x_ - message->pose.pose.position.x, ey = goal_y_ - message->pose.pose.position.y;
        geometry_msgs::Twist command;
        command.linear.x = std::max(-1.0, std::min(1.0, x_.step(ex, dt)));
        command.linear.y = std::max(-1.0, std::min(1.0, y_.step(ey, dt)));
        commands_.publish(command);
        std_msgs::Float64MultiArray errors;
        errors.layout.dim.resize(1);
        errors.layout.dim[0].label = frame_;
        errors.data = {ex, ey};
        errors_.publish(errors);
        if (std::abs(ex) < tolerance_ && std::abs(ey) < tolerance_) done_ = true;
    }
    void fix(const sensor_msgs::NavSatFixConstPtr& message, const std::string& source) {
        ROS_INFO_STREAM_ONCE(source << " at " << message->latitude << ", status " << int(message->status.status));
    }
    bool enable(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
        enabled_ = request.data;
        response.success = true;
        response.message = last_word_;
        return true;
    }
    void report(const ros::TimerEvent& event) {
        ROS_INFO_THROTTLE(2.0, "on at %.1f, last %.1f", event.current_real.toSec(), last_.toSec());
    }

    Pid x_, y_;
    double goal_x_ = 0.0, goal_y_ = 0.0, tolerance_ = 0.05;
    std::string frame_, last_word_ = "nothing said";
    bool enabled_ = false, done_ = false;
    ros::Time last_;
    ros::Publisher commands_, errors_;
    ros::Subscriber poses_, fixes_, words_;
    ros::ServiceServer enable_;
    ros::Timer timer_;
};

int main(int argc, char** argv) {
    ros::init(argc, argv, "pose_keeper", ros::init_options::AnonymousName);
    ros::NodeHandle node;
    ros::NodeHandle own("~");
    PoseKeeper keeper(node, own);
    ros::Rate rate(20);
    while (ros::ok() && !keeper.done()) {
        ros::spinOnce();
        rate.sleep();
    }
    own.setParam("arrived", true);
    ROS_WARN("%s has arrived", ros::this_node::getName().c_str());
    std_srvs::Empty empty;
    ros::ServiceClient stop = node.serviceClient<std_srvs::Empty>("stop");
    if (!stop.waitForExistence(ros::Duration(1.0)) || !stop.call(empty)) ROS_ERROR("no server of %s", stop.getService().c_str());
}
