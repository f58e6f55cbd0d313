// tf and tf2 in roscpp: a node that publishes frames and looks them up, in the interfaces of both.
#include <geometry_msgs/PointStamped.h>
#include <ros/ros.h>
#include <tf/transform_broadcaster.h>
#include <tf/transform_listener.h>
#include <tf2/LinearMath/Matrix3x3.h>
#include <tf2/LinearMath/Quaternion.h>
#include <tf2/utils.h>
#include <tf2_geometry_msgs/tf2_geometry_msgs.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

int main(int argc, char** argv) {
    ros::init(argc, argv, "frames");
    ros::NodeHandle node;
    int rate = 0;
    ros::param::get("~rate", rate);
    for (int index = 1; index < argc; ++index) ROS_INFO("argument %s, rate %d", argv[index], rate);
    tf2_ros::Buffer buffer;
    tf2_ros::TransformListener listener(buffer);
    tf::TransformListener old_listener;
    tf2_ros::StaticTransformBroadcaster fixed;
    tf::TransformBroadcaster broadcaster;

    geometry_msgs::TransformStamped camera;
    camera.header.frame_id = "base";
    camera.child_frame_id = "camera";
    camera.transform.translation.x = 1.0;
    tf2::Quaternion quarter;
    quarter.setRPY(0, 0, M_PI / 2);
    camera.transform.rotation = tf2::toMsg(quarter);
    fixed.sendTransform(camera);

    ROS_INFO("at first %d", buffer.canTransform("world", "base", ros::Time(0)));
    ros::Time const start = ros::Time::now();
    for (int step = 0; step < 10; ++step) {
        tf::Transform moved;
        moved.setOrigin(tf::Vector3(step, 0.0, 2.0));
        moved.setRotation(tf::createQuaternionFromYaw(0.1 * step));
        broadcaster.sendTransform(tf::StampedTransform(moved, start + ros::Duration(0.1 * step), "/world", "/base"));
        ros::Duration(0.1).sleep();
    }
    try {
        auto const found = buffer.lookupTransform("world", "base", start + ros::Duration(0.25), ros::Duration(1.0));
        auto const& t = found.transform.translation;
        ROS_INFO("between %.6f %.6f %.6f yaw %.6f", t.x, t.y, t.z, tf2::getYaw(found.transform.rotation));
    } catch (tf2::TransformException& error) {
        ROS_ERROR("%s", error.what());
    }
    tf::StampedTransform last;
    old_listener.waitForTransform("/world", "/camera", ros::Time(0), ros::Duration(1.0));
    old_listener.lookupTransform("/world", "/camera", ros::Time(0), last);
    ROS_INFO("camera %.6f %.6f %.6f yaw %.6f", last.getOrigin().x(), last.getOrigin().y(), last.getOrigin().z(),
             tf::getYaw(last.getRotation()));

    geometry_msgs::PointStamped point;
    point.header.frame_id = "camera";
    point.point.x = 1.0;
    auto const in_base = buffer.transform(point, "base");
    ROS_INFO("point %.6f %.6f %s", in_base.point.x, in_base.point.y, in_base.header.frame_id.c_str());

    double roll, pitch, yaw;
    tf2::Quaternion turned(0.1, 0.2, 0.3);
    tf2::Matrix3x3(turned.normalized()).getRPY(roll, pitch, yaw);
    ROS_INFO("angles %.6f %.6f %.6f", roll, pitch, yaw);
    ROS_INFO("slerp %.6f %.6f", quarter.slerp(turned, 0.25).z(), quarter.angleShortestPath(turned));
    tf2::Transform const pose(quarter, tf2::Vector3(1, 2, 3));
    auto const back = pose.inverseTimes(tf2::Transform(turned)).getOrigin();
    ROS_INFO("back %.6f %.6f %.6f", back.x(), back.y(), back.z());
    try {
        buffer.lookupTransform("world", "nowhere", ros::Time(0));
    } catch (const tf2::LookupException& error) {
        ROS_INFO("lookup: %s", error.what());
    }
    try {
        buffer.lookupTransform("world", "base", start + ros::Duration(100.0));
    } catch (const tf2::ExtrapolationException&) {
        ROS_INFO("extrapolation %d", buffer.canTransform("world", "base", start + ros::Duration(100.0)));
    }
    return 0;
}
