// tf::MessageFilter, with the buffer of a tf::Transformer.
#pragma once
#include "tf/transform_listener.h"
#include "tf2_ros/message_filter.h"

namespace tf {

namespace filter_failure_reasons = tf2_ros::filter_failure_reasons;
using tf2_ros::FilterFailureReason;
using tf2_ros::MessageFilterBase;

template <class Message>
class MessageFilter : public tf2_ros::MessageFilter<Message> {
    using Base = tf2_ros::MessageFilter<Message>;

public:
    MessageFilter(Transformer& tf, const std::string& target, std::uint32_t queue_size,
                  ros::NodeHandle node = ros::NodeHandle(), ros::Duration = ros::Duration(0.01))
        : Base(tf.buffer_(), target, queue_size, node) {}
    template <class Filter>
    MessageFilter(Filter& filter, Transformer& tf, const std::string& target, std::uint32_t queue_size,
                  ros::NodeHandle node = ros::NodeHandle(), ros::Duration = ros::Duration(0.01))
        : Base(filter, tf.buffer_(), target, queue_size, node) {}
};

}  // namespace tf
