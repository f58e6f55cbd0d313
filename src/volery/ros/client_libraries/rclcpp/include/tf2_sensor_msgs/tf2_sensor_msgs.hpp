// tf2::doTransform of clouds of points.
#pragma once
#include "sensor_msgs/point_cloud2_iterator.hpp"
#include "tf2_ros/geometry.hpp"

namespace tf2 {

template <>
inline void doTransform(const sensor_msgs::msg::PointCloud2& in, sensor_msgs::msg::PointCloud2& out,
                        const geometry::TransformStamped& by) {
    sensor_msgs::point_clouds::move(in, out, transform_of(by), by.header);
}

}  // namespace tf2
