// tf2's times, and its types as messages of ROS 2.
#pragma once
#include <chrono>

#include "geometry_msgs/msg/point_stamped.hpp"
#include "geometry_msgs/msg/pose_stamped.hpp"
#include "geometry_msgs/msg/quaternion_stamped.hpp"
#include "geometry_msgs/msg/transform_stamped.hpp"
#include "geometry_msgs/msg/vector3_stamped.hpp"
#include "rclcpp/node.hpp"

namespace tf2 {

namespace geometry = ::geometry_msgs::msg;
using volery::is_message;
using Duration = std::chrono::nanoseconds;
using TimePoint = std::chrono::time_point<std::chrono::system_clock, Duration>;
using Stamp = TimePoint;
using IDuration = std::chrono::duration<int, std::nano>;
constexpr TimePoint TimePointZero = TimePoint(Duration::zero());

inline TimePoint from_stamp(const builtin_interfaces::msg::Time& stamp) {
    return TimePoint(Duration(stamp.sec * 1000000000LL + stamp.nanosec));
}
inline builtin_interfaces::msg::Time to_stamp(const TimePoint& time) {
    return rclcpp::Time(time.time_since_epoch().count());
}
inline TimePoint get_now() { return TimePoint(Duration(volery::request("ros.now").integer())); }
inline Duration durationFromSec(double seconds) { return Duration(std::llround(seconds * 1e9)); }
inline TimePoint timeFromSec(double seconds) { return TimePoint(durationFromSec(seconds)); }
inline double durationToSec(const Duration& span) { return static_cast<double>(span.count()) * 1e-9; }
inline double timeToSec(const TimePoint& time) { return durationToSec(time.time_since_epoch()); }

}  // namespace tf2

#include "tf2/geometry.h"

namespace tf2_ros {

inline builtin_interfaces::msg::Time toMsg(const tf2::TimePoint& time) { return tf2::to_stamp(time); }
inline tf2::TimePoint fromMsg(const builtin_interfaces::msg::Time& stamp) { return tf2::from_stamp(stamp); }
inline builtin_interfaces::msg::Duration toMsg(const tf2::Duration& span) { return rclcpp::Duration(span); }
inline tf2::Duration fromMsg(const builtin_interfaces::msg::Duration& span) {
    return tf2::Duration(rclcpp::Duration(span).nanoseconds());
}
inline tf2::TimePoint fromRclcpp(const rclcpp::Time& time) { return tf2::TimePoint(tf2::Duration(time.nanoseconds())); }
inline tf2::Duration fromRclcpp(const rclcpp::Duration& span) { return tf2::Duration(span.nanoseconds()); }
inline rclcpp::Time toRclcpp(const tf2::TimePoint& time) { return rclcpp::Time(time.time_since_epoch().count()); }
inline rclcpp::Duration toRclcpp(const tf2::Duration& span) { return rclcpp::Duration(span); }

}  // namespace tf2_ros
