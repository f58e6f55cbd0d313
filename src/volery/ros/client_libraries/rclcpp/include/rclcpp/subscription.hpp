// rclcpp::Subscription, and the conversion of a message to the argument of a callback.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "rclcpp/publisher.hpp"

namespace rclcpp {

struct SubscriptionOptions {
    EventCallbacks event_callbacks;
    bool use_default_callbacks = true;
    bool ignore_local_publications = false;
    CallbackGroup::SharedPtr callback_group;
    IntraProcessSetting use_intra_process_comm = IntraProcessSetting::NodeDefault;
    QosOverridingOptions qos_overriding_options;
    struct {
        std::string filter_expression;
        std::vector<std::string> expression_parameters;
    } content_filter_options;
    struct {
        int state = 0;
        std::string publish_topic;
        std::chrono::milliseconds publish_period{1000};
    } topic_stats_options;
};
template <class Allocator = std::allocator<void>>
using SubscriptionOptionsWithAllocator = SubscriptionOptions;

namespace detail {

template <class>
constexpr bool no_callback = false;

template <class Message>
std::unique_ptr<Message> received(volery::Reader in) {
    auto message = std::make_unique<Message>();
    volery::from_bytes(in, *message);
    return message;
}
inline std::string rest(volery::Reader in) {
    auto const size = in.left();
    return std::string(in.take(size), size);
}
inline MessageInfo info_of(volery::Reader& in) {
    rmw_message_info_t info;
    info.source_timestamp = info.received_timestamp = in.integer();
    info.publication_sequence_number = info.reception_sequence_number = static_cast<std::uint64_t>(in.integer());
    return MessageInfo(info);
}

// Call back with the form of the message that the callback takes.
template <class Message, class Callback>
void deliver(Callback& callback, volery::Reader in) {
    using Shared = std::shared_ptr<Message>;
    using Unique = std::unique_ptr<Message>;
    using Bytes = std::shared_ptr<SerializedMessage>;
    using Info = const MessageInfo&;
    [[maybe_unused]] auto const info = info_of(in);
    if constexpr (std::is_invocable_v<Callback&, Shared>)
        callback(Shared(received<Message>(in)));
    else if constexpr (std::is_invocable_v<Callback&, Unique>)
        callback(received<Message>(in));
    else if constexpr (std::is_invocable_v<Callback&, const Message&>)
        callback(static_cast<const Message&>(*received<Message>(in)));
    else if constexpr (std::is_invocable_v<Callback&, Bytes>)
        callback(std::make_shared<SerializedMessage>(rest(in)));
    else if constexpr (std::is_invocable_v<Callback&, Shared, Info>)
        callback(Shared(received<Message>(in)), info);
    else if constexpr (std::is_invocable_v<Callback&, Unique, Info>)
        callback(received<Message>(in), info);
    else if constexpr (std::is_invocable_v<Callback&, const Message&, Info>)
        callback(static_cast<const Message&>(*received<Message>(in)), info);
    else if constexpr (std::is_invocable_v<Callback&, Bytes, Info>)
        callback(std::make_shared<SerializedMessage>(rest(in)), info);
    else
        static_assert(no_callback<Callback>, "this callback takes no message of the subscription's type");
}

}  // namespace detail

class SubscriptionBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(SubscriptionBase)
    virtual ~SubscriptionBase() = default;
    const char* get_topic_name() const { return entity_->name().c_str(); }
    std::size_t get_publisher_count() const {
        return static_cast<std::size_t>(volery::request("ros.publishers", volery::Writer().put(entity_->handle())).integer());
    }
    QoS get_actual_qos() const { return qos_; }
    bool is_serialized() const { return false; }

protected:
    SubscriptionBase(const node_interfaces::NodeState::SharedPtr& node, const std::string& topic, const std::string& type,
                     const QoS& qos, const SubscriptionOptions& options, volery::Callable callback)
        : node_(node), group_(options.callback_group), qos_(qos) {
        if (!options.content_filter_options.filter_expression.empty())
            throw std::runtime_error("content filters of subscriptions are not offered: test the message in the callback");
        auto const callable = volery::register_callable(std::move(callback));
        auto with = volery::Writer().put(node->number()).put(topic).put(type);
        detail::put(with, qos);
        with.put(callable).put(node->group(group_).number());
        auto answer = detail::ask("ros.subscribe", with);
        auto const number = answer.integer();
        entity_ = std::make_unique<volery::Entity>(number, answer.text(), callable);
        events_ = options.event_callbacks.watch(number, node->group(group_));
    }

private:
    node_interfaces::NodeState::SharedPtr node_;
    CallbackGroup::SharedPtr group_;
    QoS qos_;
    std::unique_ptr<volery::Entity> entity_;
    std::vector<std::unique_ptr<volery::Entity>> events_;
};

template <class Message, class Allocator = std::allocator<void>>
class Subscription : public SubscriptionBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Subscription)
    template <class Callback>
    Subscription(const node_interfaces::NodeState::SharedPtr& node, const std::string& topic, const QoS& qos,
                 const SubscriptionOptions& options, Callback callback)
        : SubscriptionBase(node, topic, Message::name_(), qos, options,
                           [callback = std::make_shared<Callback>(std::move(callback))](volery::Reader in, volery::Writer&) {
                               detail::deliver<Message>(*callback, in);
                           }) {}
};

// Receives messages of a type that is known when the node runs, in CDR.
class GenericSubscription : public SubscriptionBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(GenericSubscription)
    template <class Callback>
    GenericSubscription(const node_interfaces::NodeState::SharedPtr& node, const std::string& topic,
                        const std::string& type, const QoS& qos, const SubscriptionOptions& options, Callback callback)
        : SubscriptionBase(node, topic, type, qos, options,
                           [callback = std::make_shared<Callback>(std::move(callback))](volery::Reader in, volery::Writer&) {
                               detail::info_of(in);
                               (*callback)(std::make_shared<SerializedMessage>(detail::rest(in)));
                           }) {}
};

}  // namespace rclcpp
