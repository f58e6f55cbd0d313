// ros::Subscriber, and the conversion of a message to the argument of a callback.
#pragma once
#include <boost/function.hpp>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "ros/callback_queue.h"
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
using VoidConstPtr = detail::VoidConstPtr;

// A message together with who sent it and when it arrived.
template <class Type>
class MessageEvent {
public:
    using Message = std::remove_cv_t<Type>;
    using ConstMessagePtr = boost::shared_ptr<Message const>;
    using MessagePtr = boost::shared_ptr<Message>;

    MessageEvent() = default;
    MessageEvent(const ConstMessagePtr& message) : MessageEvent(message, Time::now()) {}
    MessageEvent(const ConstMessagePtr& message, Time received) : message_(message), received_(received) {}
    template <class Other>
    MessageEvent(const MessageEvent<Other>& other)
        : message_(other.getConstMessage()), received_(other.getReceiptTime()) {}

    ConstMessagePtr getConstMessage() const { return message_; }
    // A copy that may be changed, unless the event is of constant messages.
    boost::shared_ptr<Type> getMessage() const {
        if constexpr (std::is_const_v<Type>)
            return message_;
        else
            return boost::make_shared<Message>(*message_);
    }
    VOLERY_REFUSED("ros::MessageEvent::getPublisherName is not offered: the graph does not tell who published")
    const std::string& getPublisherName() const;
    Time getReceiptTime() const { return received_; }

private:
    ConstMessagePtr message_;
    Time received_;
};

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
template <class Type>
struct Adapter<MessageEvent<Type>> {
    using Message = std::remove_cv_t<Type>;
    static MessageEvent<Type> from(const boost::shared_ptr<Message>& message) { return {message, Time::now()}; }
};
template <class Parameter>
using Adapted = Adapter<std::remove_cv_t<std::remove_reference_t<Parameter>>>;

template <class Message>
boost::shared_ptr<Message> received(volery::Reader in) {
    auto message = boost::make_shared<Message>();
    from_bytes(in, *message);
    return message;
}

// Calls back with the message that it is given in bytes.
using Deliver = std::function<void(volery::Reader)>;

template <class Parameter, class Callback>
Deliver delivering(Callback callback) {
    using Adapter = Adapted<Parameter>;
    return [callback](volery::Reader in) { callback(Adapter::from(received<typename Adapter::Message>(in))); };
}

}  // namespace detail

struct SubscribeOptions {
    SubscribeOptions() = default;

    template <class Parameter>
    void initByFullCallbackType(const std::string& name, std::uint32_t size,
                                const boost::function<void(Parameter)>& callback) {
        topic = name;
        queue_size = size;
        datatype = detail::Adapted<Parameter>::Message::name_();
        deliver_ = detail::delivering<Parameter>(callback);
    }
    template <class Message>
    void init(const std::string& name, std::uint32_t size,
              const boost::function<void(const boost::shared_ptr<Message const>&)>& callback) {
        initByFullCallbackType<const boost::shared_ptr<Message const>&>(name, size, callback);
    }
    template <class Message>
    static SubscribeOptions create(const std::string& topic, std::uint32_t queue_size,
                                   const boost::function<void(const boost::shared_ptr<Message const>&)>& callback,
                                   const VoidConstPtr& tracked, CallbackQueueInterface* queue) {
        SubscribeOptions made;
        made.init<Message>(topic, queue_size, callback);
        made.tracked_object = tracked;
        made.callback_queue = queue;
        return made;
    }

    std::string topic;
    std::uint32_t queue_size = 1;
    std::string datatype;
    CallbackQueueInterface* callback_queue = nullptr;
    bool allow_concurrent_callbacks = false;
    VoidConstPtr tracked_object;
    TransportHints transport_hints;
    detail::Deliver deliver_;
};

// Copies share the subscription, which ends with the last copy.
class Subscriber : public detail::Handle {
public:
    using Handle::Handle;
    std::string getTopic() const { return name(); }
    std::uint32_t getNumPublishers() const { return static_cast<std::uint32_t>(count("ros.publishers")); }
};
using V_Subscriber = std::vector<Subscriber>;

}  // namespace ros
