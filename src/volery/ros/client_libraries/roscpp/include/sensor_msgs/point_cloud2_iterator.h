// sensor_msgs::PointCloud2Iterator and PointCloud2Modifier.
#pragma once
#include "sensor_msgs/PointCloud2.h"
#include "sensor_msgs/point_cloud_fields.h"

namespace sensor_msgs {

using PointCloud2Modifier = point_clouds::Modifier<PointCloud2>;
template <class Value>
using PointCloud2Iterator = point_clouds::Iterator<PointCloud2, Value>;
template <class Value>
using PointCloud2ConstIterator = point_clouds::Iterator<const PointCloud2, Value>;

}  // namespace sensor_msgs
