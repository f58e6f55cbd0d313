// sensor_msgs::PointCloud2Iterator and PointCloud2Modifier.
#pragma once
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "sensor_msgs/point_cloud_fields.h"

namespace sensor_msgs {

using PointCloud2Modifier = point_clouds::Modifier<msg::PointCloud2>;
template <class Value>
using PointCloud2Iterator = point_clouds::Iterator<msg::PointCloud2, Value>;
template <class Value>
using PointCloud2ConstIterator = point_clouds::Iterator<const msg::PointCloud2, Value>;

}  // namespace sensor_msgs
