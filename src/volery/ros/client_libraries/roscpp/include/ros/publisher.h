// ros::Publisher, the callbacks of its connections, and ros::AdvertiseOptions.
#pragma once
#include <boost/function.hpp>
#include <string>
#include <vector>

#include "ros/callback_queue.h"
#include "ros/entity.h"
#include "ros/message.h"

namespace ros {

// Copies share the advertisement, which ends with the last copy.
class Publisher : public detail::Handle {
public:
    Publisher() = default;
    Publisher(std::shared_ptr<detail::Entity> entity, bool latched) : Handle(std::move(entity)), latched_(latched) {}

    template <class Message>
    void publish(const Message& message) const {
        if (!entity_) throw Exception("publish() on an invalid ros::Publisher");
        volery::request("ros.publish", volery::Writer().put(entity_->handle()).put(detail::to_bytes(message)));
    }
    template <class Message>
    void publish(const boost::shared_ptr<Message>& message) const {
        publish(*message);
    }
    std::string getTopic() const { return name(); }
    std::uint32_t getNumSubscribers() const { return static_cast<std::uint32_t>(count("ros.subscribers")); }
    bool isLatched() const { return latched_; }

private:
    bool latched_ = false;
};
using V_Publisher = std::vector<Publisher>;

// Publishes to the one subscription that has just been connected.
class SingleSubscriberPublisher {
public:
    SingleSubscriberPublisher(std::int64_t publisher, std::int64_t connection, std::string topic, std::string node)
        : publisher_(publisher), connection_(connection), topic_(std::move(topic)), node_(std::move(node)) {}
    SingleSubscriberPublisher(const SingleSubscriberPublisher&) = delete;
    SingleSubscriberPublisher& operator=(const SingleSubscriberPublisher&) = delete;

    template <class Message>
    void publish(const Message& message) const {
        auto const with = volery::Writer().put(publisher_).put(connection_).put(detail::to_bytes(message));
        volery::request("ros.publish_to", with);
    }
    template <class Message>
    void publish(const boost::shared_ptr<Message>& message) const {
        publish(*message);
    }
    std::string getTopic() const { return topic_; }
    std::string getSubscriberName() const { return node_; }

private:
    std::int64_t publisher_, connection_;
    std::string topic_, node_;
};
using SubscriberStatusCallback = boost::function<void(const SingleSubscriberPublisher&)>;

struct AdvertiseOptions {
    AdvertiseOptions() = default;
    AdvertiseOptions(const std::string& topic, std::uint32_t queue_size, const std::string&, const std::string& type,
                     const std::string&, const SubscriberStatusCallback& connect = SubscriberStatusCallback(),
                     const SubscriberStatusCallback& disconnect = SubscriberStatusCallback())
        : topic(topic), queue_size(queue_size), datatype(type), connect_cb(connect), disconnect_cb(disconnect) {}

    template <class Message>
    void init(const std::string& name, std::uint32_t size,
              const SubscriberStatusCallback& connect = SubscriberStatusCallback(),
              const SubscriberStatusCallback& disconnect = SubscriberStatusCallback()) {
        topic = name;
        queue_size = size;
        datatype = Message::name_();
        connect_cb = connect;
        disconnect_cb = disconnect;
    }
    template <class Message>
    static AdvertiseOptions create(const std::string& topic, std::uint32_t queue_size,
                                   const SubscriberStatusCallback& connect, const SubscriberStatusCallback& disconnect,
                                   const detail::VoidConstPtr& tracked, CallbackQueueInterface* queue) {
        AdvertiseOptions made;
        made.init<Message>(topic, queue_size, connect, disconnect);
        made.tracked_object = tracked;
        made.callback_queue = queue;
        return made;
    }

    std::string topic;
    std::uint32_t queue_size = 1;
    std::string datatype;
    SubscriberStatusCallback connect_cb, disconnect_cb;
    CallbackQueueInterface* callback_queue = nullptr;
    detail::VoidConstPtr tracked_object;
    bool latch = false;
};

}  // namespace ros
