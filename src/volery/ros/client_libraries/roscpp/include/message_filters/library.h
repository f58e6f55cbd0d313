// What the filters take of roscpp: pointers, events and times.
#pragma once
#include "ros/message_traits.h"
#include "ros/node_handle.h"

namespace message_filters {
namespace library {

template <class Message>
using Event = ros::MessageEvent<Message const>;
template <class Message>
using Pointer = boost::shared_ptr<Message>;
template <class Signature>
using Function = boost::function<Signature>;
using ros::Duration;
using ros::Time;

inline Time now() { return Time::now(); }
inline Time time(std::int64_t nanoseconds) { return Time().fromNSec(static_cast<std::uint64_t>(nanoseconds)); }
inline std::int64_t nanoseconds(const Time& time) { return static_cast<std::int64_t>(time.toNSec()); }
inline std::int64_t nanoseconds(const Duration& span) { return span.toNSec(); }
// Stamp in ns, and frame.
template <class Message>
std::int64_t stamp(const Event<Message>& event) {
    return nanoseconds(ros::message_traits::TimeStamp<Message>::value(*event.getConstMessage()));
}
template <class Message>
std::string frame(const Event<Message>& event) {
    return ros::message_traits::FrameId<Message>::value(*event.getConstMessage());
}

}  // namespace library
}  // namespace message_filters
