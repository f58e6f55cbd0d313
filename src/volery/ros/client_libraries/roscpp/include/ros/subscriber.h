// ros::Subscriber, and the conversion of a message to the argument of a callback.
#pragma once
#include <boost/function.hpp>
#include <string>
#include <type_traits>

#include "ros/entity.h"
#include "ros/message.h"

namespace ros {

// Accepted wherever roscpp takes transport hints, without effect.
class TransportHints {
public:
    TransportHints& reliable() { return *this; }
    TransportHints& unreliable() { return *this; }
    TransportHints& tcp() { return *this; }
    TransportHints& udp() { return *this; }
    TransportHints& tcpNoDelay(bool = true) { return *this; }
};

using VoidPtr = boost::shared_ptr<void>;
using VoidConstPtr = boost::shared_ptr<void const>;

namespace detail {

// The message type of a callback's parameter, and the conversion of a message to the parameter.
template <class Parameter>
struct Adapter {
    using Message = std::remove_cv_t<Parameter>;
    static const Message& from(const boost::shared_ptr<Message>& message) { return *message; }
};
template <class Type>
struct Adapter<boost::shared_ptr<Type>> {
    using Message = std::remove_cv_t<Type>;
    static boost::shared_ptr<Type> from(const boost::shared_ptr<Message>& message) { return message; }
};
template <class Parameter>
using Adapted = Adapter<std::remove_cv_t<std::remove_reference_t<Parameter>>>;

template <class Message>
boost::shared_ptr<Message> received(volery::Reader in) {
    auto message = boost::make_shared<Message>();
    from_bytes(in, *message);
    return message;
}

}  // namespace detail

// Copies share the subscription, which ends with the last copy.
class Subscriber : public detail::Handle {
public:
    using Handle::Handle;
    std::string getTopic() const { return name(); }
    std::uint32_t getNumPublishers() const { return static_cast<std::uint32_t>(count("ros.publishers")); }
};

}  // namespace ros
