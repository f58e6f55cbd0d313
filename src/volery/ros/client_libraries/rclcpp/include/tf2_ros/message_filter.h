// tf2_ros::MessageFilter of rclcpp.
#pragma once
#include "tf2_ros/tf2_ros.hpp"
#include "tf2_ros/transform_filter.h"

namespace tf2_ros {

template <class Message, class BufferType = Buffer>
class MessageFilter : public TransformFilter<Message> {
    using State = rclcpp::node_interfaces::NodeState::SharedPtr;
    static constexpr auto FOR_EVER = std::chrono::nanoseconds::max();

public:
    // With the node, or two of its interfaces.
    template <class NodeType, class Rep = std::int64_t, class Period = std::nano>
    MessageFilter(BufferType& buffer, const std::string& target, std::uint32_t queue_size, const NodeType& node,
                  std::chrono::duration<Rep, Period> buffer_timeout = FOR_EVER)
        : TransformFilter<Message>(buffer, target, queue_size,
                                   rclcpp::detail::state_of(node)->get_default_callback_group()->number(),
                                   std::chrono::nanoseconds(buffer_timeout).count()) {}
    template <class Rep = std::int64_t, class Period = std::nano>
    MessageFilter(BufferType& buffer, const std::string& target, std::uint32_t queue_size, const State& node, const State&,
                  std::chrono::duration<Rep, Period> buffer_timeout = FOR_EVER)
        : MessageFilter(buffer, target, queue_size, node, buffer_timeout) {}
    template <class Filter, class... Others>
    MessageFilter(Filter& filter, BufferType& buffer, const std::string& target, std::uint32_t queue_size,
                  const Others&... others)
        : MessageFilter(buffer, target, queue_size, others...) {
        this->connectInput(filter);
    }
};

}  // namespace tf2_ros
