// tf2_ros::MessageFilter of roscpp.
#pragma once
#include "tf2_ros/buffer.h"
#include "tf2_ros/transform_filter.h"

namespace tf2_ros {

template <class Message>
class MessageFilter : public TransformFilter<Message> {
public:
    MessageFilter(tf2::BufferCore& buffer, const std::string& target, std::uint32_t queue_size,
                  ros::CallbackQueueInterface* queue)
        : TransformFilter<Message>(buffer, target, queue_size, ros::detail::number_of(queue)) {}
    MessageFilter(tf2::BufferCore& buffer, const std::string& target, std::uint32_t queue_size,
                  const ros::NodeHandle& node)
        : MessageFilter(buffer, target, queue_size, node.getCallbackQueue()) {}
    template <class Filter, class Where>
    MessageFilter(Filter& filter, tf2::BufferCore& buffer, const std::string& target, std::uint32_t queue_size,
                  Where&& where)
        : MessageFilter(buffer, target, queue_size, std::forward<Where>(where)) {
        this->connectInput(filter);
    }
};

}  // namespace tf2_ros
