// ros::message_traits: the header of a message, and the name of its type.
#pragma once
#include "ros/message.h"

namespace ros {
namespace message_traits {
namespace detail {

template <class Message, class = void>
struct HasHeader : std::false_type {};
template <class Message>
struct HasHeader<Message, std::void_t<decltype(std::declval<Message>().header.stamp)>> : std::true_type {};

}  // namespace detail

template <class Message>
struct HasHeader : detail::HasHeader<Message> {};
template <class Message>
constexpr bool hasHeader() {
    return HasHeader<Message>::value;
}

// Stamp and frame of the header.
template <class Message, class = void>
struct TimeStamp {
    static_assert(HasHeader<Message>::value, "this type of message has no header, and so no stamp");
    static Time value(const Message& message) { return message.header.stamp; }
    static Time* pointer(Message& message) { return &message.header.stamp; }
};
template <class Message, class = void>
struct FrameId {
    static_assert(HasHeader<Message>::value, "this type of message has no header, and so no frame");
    static std::string value(const Message& message) { return message.header.frame_id; }
    static std::string* pointer(Message& message) { return &message.header.frame_id; }
};
template <class Message>
struct Header {
    static auto* pointer(Message& message) { return &message.header; }
    static const auto* pointer(const Message& message) { return &message.header; }
};
// The name as ROS 1 has it: package/Type.
template <class Message>
struct DataType {
    static const char* value() {
        static std::string const name = [] {
            std::string full = Message::name_();
            return full.substr(0, full.find('/')) + full.substr(full.rfind('/'));
        }();
        return name.c_str();
    }
    static const char* value(const Message&) { return value(); }
};
template <class Message>
const char* datatype() {
    return DataType<Message>::value();
}
template <class Message>
const char* datatype(const Message&) {
    return DataType<Message>::value();
}
template <class Message>
Time* timeStamp(Message& message) {
    return TimeStamp<Message>::pointer(message);
}

}  // namespace message_traits
}  // namespace ros
