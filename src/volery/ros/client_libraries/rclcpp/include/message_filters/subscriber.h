// message_filters::Subscriber, the source of most chains of filters.
#pragma once
#include "message_filters/simple_filter.h"

namespace message_filters {

template <class NodeType = rclcpp::Node>
class SubscriberBase {
public:
    using SharedPtr = std::shared_ptr<SubscriberBase>;
    virtual ~SubscriberBase() = default;
    virtual void subscribe() = 0;
    virtual void unsubscribe() = 0;
};

template <class Message, class NodeType = rclcpp::Node>
class Subscriber : public SubscriberBase<NodeType>, public SimpleFilter<Message> {
public:
    using NodePtr = std::shared_ptr<NodeType>;
    using MessageType = Message;
    using typename SimpleFilter<Message>::EventType;
    using typename SimpleFilter<Message>::MConstPtr;
    Subscriber() = default;
    // Of a node or a pointer to one.
    template <class Where, class Quality = rmw_qos_profile_t>
    Subscriber(Where&& node, const std::string& topic, const Quality& qos = rmw_qos_profile_default,
               const rclcpp::SubscriptionOptions& options = {}) {
        subscribe(node, topic, qos, options);
    }

    template <class Where>
    void subscribe(Where&& node, const std::string& topic, const rclcpp::QoS& qos,
                   const rclcpp::SubscriptionOptions& options = {}) {
        unsubscribe();
        if (topic.empty()) return;
        node_ = rclcpp::detail::state_of(node);
        topic_ = topic;
        qos_ = qos;
        options_ = options;
        subscribe();
    }
    template <class Where>
    void subscribe(Where&& node, const std::string& topic, const rmw_qos_profile_t& qos = rmw_qos_profile_default,
                   const rclcpp::SubscriptionOptions& options = {}) {
        subscribe(node, topic, rclcpp::QoS(rclcpp::QoSInitialization::from_rmw(qos), qos), options);
    }
    void subscribe() override {
        unsubscribe();
        if (topic_.empty()) return;
        subscription_ = std::make_shared<rclcpp::Subscription<Message>>(
            node_, topic_, qos_, options_, [this](const MConstPtr& message) { this->signalMessage(message); });
    }
    void unsubscribe() override { subscription_.reset(); }
    std::string getTopic() const { return topic_; }
    typename rclcpp::Subscription<Message>::SharedPtr getSubscriber() const { return subscription_; }
    template <class Filter>
    void connectInput(Filter&) {}
    void add(const EventType&) {}

private:
    typename rclcpp::Subscription<Message>::SharedPtr subscription_;
    rclcpp::node_interfaces::NodeState::SharedPtr node_;
    std::string topic_;
    rclcpp::QoS qos_{10};
    rclcpp::SubscriptionOptions options_;
};

}  // namespace message_filters
