// Filters of messages, with the policies of their synchronizers, and parameters of any kind.
#include <geometry_msgs/PointStamped.h>
#include <geometry_msgs/PoseStamped.h>
#include <message_filters/cache.h>
#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/approximate_time.h>
#include <message_filters/sync_policies/exact_time.h>
#include <message_filters/time_synchronizer.h>
#include <ros/ros.h>
#include <tf/message_filter.h>
#include <tf2_ros/message_filter.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>

using geometry_msgs::PointStamped;
using geometry_msgs::PoseStamped;

void exact(const geometry_msgs::PointStampedConstPtr& point, const geometry_msgs::PoseStampedConstPtr& pose) {
    ROS_INFO("exact %.1f %.1f", point->point.x, pose->pose.position.x);
}

struct Node {
    using Policy = message_filters::sync_policies::ApproximateTime<PointStamped, PoseStamped>;
    ros::NodeHandle node;
    message_filters::Subscriber<PointStamped> points{node, "points", 10};
    message_filters::Subscriber<PoseStamped> poses;
    message_filters::TimeSynchronizer<PointStamped, PoseStamped> exactly{points, poses, 10};
    boost::shared_ptr<message_filters::Synchronizer<Policy>> nearly;
    message_filters::Cache<PointStamped> cache{points, 2};
    tf2_ros::Buffer buffer;
    tf2_ros::TransformListener listener{buffer};
    tf2_ros::MessageFilter<PointStamped> known{points, buffer, "world", 5, node};

    Node() {
        poses.subscribe(node, "poses", 10);
        exactly.registerCallback(boost::bind(&exact, _1, _2));
        nearly.reset(new message_filters::Synchronizer<Policy>(Policy(10), points, poses));
        nearly->registerCallback(&Node::near, this);
        known.registerCallback(&Node::inFrame, this);
        known.registerFailureCallback([](const geometry_msgs::PointStampedConstPtr& one, tf2_ros::FilterFailureReason why) {
            ROS_INFO("failed %.1f %d", one->point.x, static_cast<int>(why));
        });
    }
    void near(const geometry_msgs::PointStampedConstPtr& point, const PoseStamped& pose) {
        ROS_INFO("near %.1f %.1f", point->point.x, pose.pose.position.x);
    }
    void inFrame(const boost::shared_ptr<const PointStamped>& one) { ROS_INFO("known %.1f", one->point.x); }
};

int main(int argc, char** argv) {
    ros::init(argc, argv, "filters");
    Node node;
    ros::Publisher point_out = node.node.advertise<PointStamped>("points", 10);
    ros::Publisher pose_out = node.node.advertise<PoseStamped>("poses", 10);
    tf2_ros::TransformBroadcaster broadcaster;
    ros::Time const start = ros::Time::now();
    auto const point = [&](double at) {
        PointStamped made;
        made.header.frame_id = "/base";
        made.header.stamp = start + ros::Duration(at);
        made.point.x = at;
        point_out.publish(made);
        ros::Duration(0.05).sleep();
        ros::spinOnce();
    };
    auto const pose = [&](double at) {
        PoseStamped made;
        made.header.stamp = start + ros::Duration(at);
        made.pose.position.x = at;
        pose_out.publish(made);
        ros::Duration(0.05).sleep();
        ros::spinOnce();
    };
    auto const frame = [&](double at) {
        geometry_msgs::TransformStamped made;
        made.header.frame_id = "world";
        made.child_frame_id = "base";
        made.header.stamp = start + ros::Duration(at);
        made.transform.rotation.w = 1;
        broadcaster.sendTransform(made);
        ros::Duration(0.05).sleep();
        ros::spinOnce();
    };
    point(0.1), pose(0.1), frame(0.0);
    point(0.2), pose(0.21), frame(0.15);
    point(0.3), pose(0.3), frame(0.25);
    point(0.4), pose(0.45), point(0.5), pose(0.52), frame(0.6);
    ROS_INFO_STREAM("kept " << node.cache.getOldestTime() - start << " to " << node.cache.getLatestTime() - start);
    ros::Duration(0.1).sleep();
    ros::spinOnce();

    XmlRpc::XmlRpcValue value;
    ros::NodeHandle("~").getParam("places", value);
    for (int index = 0; index < value.size(); ++index)
        ROS_INFO_STREAM(std::string(value[index]["name"]) << " " << static_cast<double>(value[index]["at"][1]));
    ROS_INFO_STREAM("value " << value);
    try {
        ROS_INFO("%f", static_cast<double>(value[0]["level"]));
    } catch (const XmlRpc::XmlRpcException& error) {
        ROS_INFO_STREAM("wrong " << error.getMessage() << " " << int(value[0]["level"]));
    }
    value[1]["name"] = "there";
    ros::param::set("/copy", value);
    ROS_INFO("set %d", ros::param::get("/copy", value) && value.getType() == XmlRpc::XmlRpcValue::TypeArray);
    for (auto& one : value[1]) ROS_INFO_STREAM(one.first << "=" << one.second);
    return 0;
}
