// The same mission for one autopilot, ArduPilot behind MAVROS, with ROS alone: modes, services, set-points that are
// repeated, telemetry that is waited for. It compiles with roscpp, too.
#include <cmath>
#include <geometry_msgs/PoseStamped.h>
#include <mavros_msgs/CommandBool.h>
#include <mavros_msgs/CommandTOL.h>
#include <mavros_msgs/GlobalPositionTarget.h>
#include <mavros_msgs/SetMode.h>
#include <mavros_msgs/State.h>
#include <ros/ros.h>
#include <sensor_msgs/NavSatFix.h>

namespace {

constexpr double HEIGHT = 20.0;            // metres above home
constexpr double ALTITUDE = 32.0;          // metres above mean sea level
constexpr double METRES_PER_DEGREE = 111320.0;
constexpr double NEAR = 1.0;               // metres
constexpr std::uint16_t POSITION_ONLY = 8 | 16 | 32 | 64 | 128 | 256 | 1024 | 2048;

mavros_msgs::State state;
sensor_msgs::NavSatFix fix;
geometry_msgs::PoseStamped pose;

void on_state(const mavros_msgs::State::ConstPtr& message) { state = *message; }
void on_fix(const sensor_msgs::NavSatFix::ConstPtr& message) { fix = *message; }
void on_pose(const geometry_msgs::PoseStamped::ConstPtr& message) { pose = *message; }

double metres_to(double latitude, double longitude) {
    double const north = (latitude - fix.latitude) * METRES_PER_DEGREE;
    double const east = (longitude - fix.longitude) * METRES_PER_DEGREE * std::cos(latitude * M_PI / 180.0);
    return std::hypot(north, east);
}

bool change_mode(ros::ServiceClient& client, ros::Rate& rate, const std::string& mode) {
    mavros_msgs::SetMode request;
    request.request.custom_mode = mode;
    if (!client.call(request) || !request.response.mode_sent) return false;
    while (ros::ok() && state.mode != mode) {
        ros::spinOnce();
        rate.sleep();
    }
    return true;
}

void go(ros::Publisher& setpoints, ros::Rate& rate, double latitude, double longitude) {
    mavros_msgs::GlobalPositionTarget target;
    target.coordinate_frame = mavros_msgs::GlobalPositionTarget::FRAME_GLOBAL_INT;
    target.type_mask = POSITION_ONLY;
    target.latitude = latitude;
    target.longitude = longitude;
    target.altitude = ALTITUDE;
    while (ros::ok() && metres_to(latitude, longitude) > NEAR) {
        target.header.stamp = ros::Time::now();
        setpoints.publish(target);
        ros::spinOnce();
        rate.sleep();
    }
    ROS_INFO("%.5f, %.5f is reached", latitude, longitude);
}

}  // namespace

int main(int argc, char** argv) {
    ros::init(argc, argv, "by_hand");
    ros::NodeHandle node;
    ros::Subscriber states = node.subscribe("mavros/state", 10, on_state);
    ros::Subscriber fixes = node.subscribe("mavros/global_position/global", 10, on_fix);
    ros::Subscriber poses = node.subscribe("mavros/local_position/pose", 10, on_pose);
    ros::Publisher setpoints = node.advertise<mavros_msgs::GlobalPositionTarget>("mavros/setpoint_raw/global", 10);
    ros::ServiceClient set_mode = node.serviceClient<mavros_msgs::SetMode>("mavros/set_mode");
    ros::ServiceClient arming = node.serviceClient<mavros_msgs::CommandBool>("mavros/cmd/arming");
    ros::ServiceClient takeoff = node.serviceClient<mavros_msgs::CommandTOL>("mavros/cmd/takeoff");
    ros::Rate rate(10.0);

    while (ros::ok() && (!state.connected || fix.header.stamp.isZero())) {
        ros::spinOnce();
        rate.sleep();
    }
    if (!change_mode(set_mode, rate, "GUIDED")) {
        ROS_ERROR("the mode GUIDED is refused");
        return 1;
    }

    mavros_msgs::CommandBool arm;
    arm.request.value = true;
    while (ros::ok() && !state.armed) {  // refused until its own checks pass
        if (!arming.call(arm) || !arm.response.success) ros::Duration(1.0).sleep();
        ros::spinOnce();
        rate.sleep();
    }

    mavros_msgs::CommandTOL climb;
    climb.request.altitude = HEIGHT;
    if (!takeoff.call(climb) || !climb.response.success) {
        ROS_ERROR("the take-off is refused");
        return 1;
    }
    while (ros::ok() && pose.pose.position.z < HEIGHT - 0.5) {
        ros::spinOnce();
        rate.sleep();
    }
    ROS_INFO("%.1f m above home", pose.pose.position.z);

    go(setpoints, rate, 43.47215, -3.79910);
    go(setpoints, rate, 43.47230, -3.79985);
    go(setpoints, rate, 43.47170, -3.79970);

    change_mode(set_mode, rate, "LAND");
    while (ros::ok() && state.armed) {
        ros::spinOnce();
        rate.sleep();
    }
    ROS_INFO("landed");
    return 0;
}
