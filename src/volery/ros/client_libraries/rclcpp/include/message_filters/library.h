// What the filters take of rclcpp: pointers, events and times.
#pragma once
#include "rclcpp/node.hpp"

namespace message_filters {

// A message, and when it was received.
template <class Type>
class MessageEvent {
public:
    using Message = std::remove_cv_t<Type>;
    using ConstMessagePtr = std::shared_ptr<Message const>;
    using MessagePtr = std::shared_ptr<Message>;

    MessageEvent() = default;
    MessageEvent(const ConstMessagePtr& message)
        : MessageEvent(message, rclcpp::Time(volery::request("ros.now").integer(), RCL_ROS_TIME)) {}
    MessageEvent(const ConstMessagePtr& message, rclcpp::Time received) : message_(message), received_(received) {}
    template <class Other>
    MessageEvent(const MessageEvent<Other>& other)
        : message_(other.getConstMessage()), received_(other.getReceiptTime()) {}

    const ConstMessagePtr& getConstMessage() const { return message_; }
    // A copy that may be changed, unless the event is of constant messages.
    std::shared_ptr<Type> getMessage() const {
        if constexpr (std::is_const_v<Type>)
            return message_;
        else
            return std::make_shared<Message>(*message_);
    }
    rclcpp::Time getReceiptTime() const { return received_; }

private:
    ConstMessagePtr message_;
    rclcpp::Time received_ = rclcpp::Time(std::int64_t{0}, RCL_ROS_TIME);
};

namespace library {

template <class Message>
using Event = MessageEvent<Message const>;
template <class Message>
using Pointer = std::shared_ptr<Message>;
template <class Signature>
using Function = std::function<Signature>;
using rclcpp::Duration;
using rclcpp::Time;

inline Time time(std::int64_t nanoseconds) { return Time(nanoseconds, RCL_ROS_TIME); }
inline Time now() { return time(volery::request("ros.now").integer()); }
inline std::int64_t nanoseconds(const Time& time) { return time.nanoseconds(); }
inline std::int64_t nanoseconds(const Duration& span) { return span.nanoseconds(); }
// Stamp in ns, and frame.
template <class Message>
std::int64_t stamp(const Event<Message>& event) {
    return Time(event.getConstMessage()->header.stamp).nanoseconds();
}
template <class Message>
std::string frame(const Event<Message>& event) {
    return event.getConstMessage()->header.frame_id;
}

}  // namespace library
}  // namespace message_filters
