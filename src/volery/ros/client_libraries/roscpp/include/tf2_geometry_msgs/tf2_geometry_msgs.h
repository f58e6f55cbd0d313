// Conversion between messages of ROS 1 and tf2's types, and transformed messages.
#pragma once
#include "geometry_msgs/PointStamped.h"
#include "geometry_msgs/PoseStamped.h"
#include "geometry_msgs/QuaternionStamped.h"
#include "geometry_msgs/TransformStamped.h"
#include "geometry_msgs/Vector3Stamped.h"
#include "ros/ros.h"

namespace tf2 {

namespace geometry = ::geometry_msgs;
using ros::is_message;
using Stamp = ros::Time;
inline Stamp from_stamp(const ros::Time& stamp) { return stamp; }
inline ros::Time to_stamp(const Stamp& stamp) { return stamp; }

}  // namespace tf2

#include "tf2/geometry.h"
