// message_filters::Subscriber, the source of most chains of filters.
#pragma once
#include "message_filters/simple_filter.h"

namespace message_filters {

class SubscriberBase {
public:
    virtual ~SubscriberBase() = default;
    virtual void subscribe(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue_size,
                           const ros::TransportHints& = ros::TransportHints(),
                           ros::CallbackQueueInterface* queue = nullptr) = 0;
    virtual void subscribe() = 0;
    virtual void unsubscribe() = 0;
};
using SubscriberBasePtr = boost::shared_ptr<SubscriberBase>;

template <class Message>
class Subscriber : public SubscriberBase, public SimpleFilter<Message> {
public:
    using typename SimpleFilter<Message>::EventType;
    Subscriber() = default;
    Subscriber(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue_size,
               const ros::TransportHints& = ros::TransportHints(), ros::CallbackQueueInterface* queue = nullptr) {
        subscribe(node, topic, queue_size, {}, queue);
    }
    ~Subscriber() override { subscription_.shutdown(); }

    void subscribe(ros::NodeHandle& node, const std::string& topic, std::uint32_t queue_size,
                   const ros::TransportHints& = ros::TransportHints(),
                   ros::CallbackQueueInterface* queue = nullptr) override {
        unsubscribe();
        if (topic.empty()) return;
        options_.initByFullCallbackType<const EventType&>(topic, queue_size,
                                                          [this](const EventType& event) { this->signalMessage(event); });
        options_.callback_queue = queue;
        node_ = std::make_unique<ros::NodeHandle>(node);
        subscribe();
    }
    void subscribe() override {
        unsubscribe();
        if (node_) subscription_ = node_->subscribe(options_);
    }
    void unsubscribe() override { subscription_.shutdown(); }
    std::string getTopic() const { return options_.topic; }
    const ros::Subscriber& getSubscriber() const { return subscription_; }
    template <class Filter>
    void connectInput(Filter&) {}
    void add(const EventType&) {}

private:
    ros::Subscriber subscription_;
    ros::SubscribeOptions options_;
    std::unique_ptr<ros::NodeHandle> node_;  // there may be none yet when a global object is made
};

}  // namespace message_filters
