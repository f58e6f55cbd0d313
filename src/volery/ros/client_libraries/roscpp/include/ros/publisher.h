// ros::Publisher.
#pragma once
#include <string>

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

}  // namespace ros
