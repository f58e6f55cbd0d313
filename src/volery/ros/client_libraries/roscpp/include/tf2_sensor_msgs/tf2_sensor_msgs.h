// tf2::doTransform of clouds of points.
#pragma once
#include "sensor_msgs/point_cloud2_iterator.h"
#include "tf2_geometry_msgs/tf2_geometry_msgs.h"

namespace tf2 {

template <>
inline void doTransform(const sensor_msgs::PointCloud2& in, sensor_msgs::PointCloud2& out,
                        const geometry::TransformStamped& by) {
    sensor_msgs::point_clouds::move(in, out, transform_of(by), by.header);
}

}  // namespace tf2
