// rclcpp::Publisher, and the state of a node that its entities use.
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rclcpp/context.hpp"
#include "rclcpp/message.hpp"
#include "rclcpp/qos.hpp"

namespace rclcpp {

enum class CallbackGroupType { MutuallyExclusive, Reentrant };

// Callbacks of a node that share a rule about concurrency.
class CallbackGroup {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(CallbackGroup)
    CallbackGroup(std::int64_t number, CallbackGroupType type) : number_(number), type_(type) {}
    CallbackGroupType type() const { return type_; }
    std::int64_t number() const { return number_; }
    bool& can_be_taken_from() { return free_; }

private:
    std::int64_t number_;
    CallbackGroupType type_;
    bool free_ = true;
};
namespace callback_group {
using rclcpp::CallbackGroup;
using rclcpp::CallbackGroupType;
}  // namespace callback_group

// What a publisher or a subscription finds out about its counterparts; each kind of event uses some of the numbers.
struct EventInfo {
    std::int64_t total_count = 0, total_count_change = 0, alive_count = 0, not_alive_count = 0, alive_count_change = 0,
                 not_alive_count_change = 0, current_count = 0, current_count_change = 0;
    rmw_qos_policy_kind_t last_policy_kind = RMW_QOS_POLICY_INVALID;
};
using QOSDeadlineRequestedInfo = EventInfo;
using QOSDeadlineOfferedInfo = EventInfo;
using QOSLivelinessChangedInfo = EventInfo;
using QOSLivelinessLostInfo = EventInfo;
using QOSMessageLostInfo = EventInfo;
using QOSOfferedIncompatibleQoSInfo = EventInfo;
using QOSRequestedIncompatibleQoSInfo = EventInfo;
using IncompatibleTypeInfo = EventInfo;
using MatchedInfo = EventInfo;
using EventCallback = std::function<void(EventInfo&)>;
using QOSDeadlineRequestedCallbackType = EventCallback;
using QOSDeadlineOfferedCallbackType = EventCallback;
using QOSLivelinessChangedCallbackType = EventCallback;
using QOSLivelinessLostCallbackType = EventCallback;
using QOSMessageLostCallbackType = EventCallback;
using QOSOfferedIncompatibleQoSCallbackType = EventCallback;
using QOSRequestedIncompatibleQoSCallbackType = EventCallback;
struct EventCallbacks {
    EventCallback deadline_callback, liveliness_callback, incompatible_qos_callback, message_lost_callback,
        incompatible_type_callback, matched_callback;

    // Call them from now on about an entity of the graph, until the entities that are returned are closed.
    std::vector<std::unique_ptr<volery::Entity>> watch(std::int64_t entity, const CallbackGroup& group) const {
        std::vector<std::unique_ptr<volery::Entity>> all;
        auto const one = [&](const char* kind, const EventCallback& callback) {
            if (!callback) return;
            auto const callable = volery::register_callable([callback](volery::Reader in, volery::Writer&) {
                EventInfo info;
                for (auto* field : {&info.total_count, &info.total_count_change, &info.alive_count, &info.not_alive_count,
                                    &info.alive_count_change, &info.not_alive_count_change, &info.current_count,
                                    &info.current_count_change})
                    *field = in.integer();
                info.last_policy_kind = static_cast<rmw_qos_policy_kind_t>(in.integer());
                callback(info);
            });
            auto const with = volery::Writer().put(entity).put(kind).put(callable).put(group.number());
            all.push_back(std::make_unique<volery::Entity>(volery::request("ros.watch", with).integer(), "", callable));
        };
        one("deadline", deadline_callback);
        one("liveliness", liveliness_callback);
        one("incompatible_qos", incompatible_qos_callback);
        one("message_lost", message_lost_callback);
        one("incompatible_type", incompatible_type_callback);
        one("matched", matched_callback);
        return all;
    }
};
using PublisherEventCallbacks = EventCallbacks;
using SubscriptionEventCallbacks = EventCallbacks;
enum class IntraProcessSetting { Enable, Disable, NodeDefault };
struct QosOverridingOptions {
    template <class... Policies>
    static QosOverridingOptions with_default_policies(Policies&&...) {
        return {};
    }
};

struct PublisherOptions {
    EventCallbacks event_callbacks;
    bool use_default_callbacks = true;
    IntraProcessSetting use_intra_process_comm = IntraProcessSetting::NodeDefault;
    CallbackGroup::SharedPtr callback_group;
    QosOverridingOptions qos_overriding_options;
};
template <class Allocator = std::allocator<void>>
using PublisherOptionsWithAllocator = PublisherOptions;

namespace node_interfaces {

// A node of the graph. It leaves the graph with the last object that shares it.
class NodeState {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(NodeState)
    NodeState(std::int64_t number, std::string name, std::string ns, std::int64_t group)
        : entity_(number, std::move(name)), namespace_(std::move(ns)),
          default_group_(std::make_shared<CallbackGroup>(group, CallbackGroupType::MutuallyExclusive)) {}

    std::int64_t number() const { return entity_.handle(); }
    const char* get_name() const { return entity_.name().c_str(); }
    const char* get_namespace() const { return namespace_.c_str(); }
    const char* get_fully_qualified_name() const {
        full_ = (namespace_ == "/" ? "" : namespace_) + "/" + entity_.name();
        return full_.c_str();
    }
    CallbackGroup::SharedPtr get_default_callback_group() const { return default_group_; }
    Context::SharedPtr get_context() const { return contexts::get_global_default_context(); }
    const CallbackGroup& group(const CallbackGroup::SharedPtr& given) const { return given ? *given : *default_group_; }
    std::string logger_name() const {
        std::string full = get_fully_qualified_name() + 1;
        for (auto& letter : full) letter = letter == '/' ? '.' : letter;
        return full;
    }

private:
    volery::Entity entity_;
    std::string namespace_;
    CallbackGroup::SharedPtr default_group_;
    mutable std::string full_;
};
using NodeBaseInterface = NodeState;
using NodeClockInterface = NodeState;
using NodeGraphInterface = NodeState;
using NodeLoggingInterface = NodeState;
using NodeParametersInterface = NodeState;
using NodeServicesInterface = NodeState;
using NodeTimersInterface = NodeState;
using NodeTopicsInterface = NodeState;
using NodeWaitablesInterface = NodeState;
using NodeTimeSourceInterface = NodeState;

}  // namespace node_interfaces

class PublisherBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(PublisherBase)
    PublisherBase(const node_interfaces::NodeState::SharedPtr& node, const std::string& topic, const std::string& type,
                  const QoS& qos, const PublisherOptions& options)
        : node_(node), qos_(qos) {
        auto with = volery::Writer().put(node->number()).put(topic).put(type);
        detail::put(with, qos);
        auto answer = detail::ask("ros.advertise", with);
        auto const number = answer.integer();
        entity_ = std::make_shared<volery::Entity>(number, answer.text());
        events_ = options.event_callbacks.watch(number, node->group(options.callback_group));
    }
    virtual ~PublisherBase() = default;

    const char* get_topic_name() const { return entity_->name().c_str(); }
    std::size_t get_subscription_count() const { return count("ros.subscribers"); }
    std::size_t get_intra_process_subscription_count() const { return 0; }
    std::size_t get_queue_size() const { return qos_.depth(); }
    QoS get_actual_qos() const { return qos_; }
    bool can_loan_messages() const { return false; }
    bool assert_liveliness() const { return volery::request("ros.assert_liveliness", volery::Writer().put(entity_->handle())).flag(); }
    template <class Rep, class Period>
    bool wait_for_all_acked(std::chrono::duration<Rep, Period> = {}) const {
        return true;  // a message is on its way when publish() returns
    }

protected:
    void send(const std::string& bytes) const {
        volery::request("ros.publish", volery::Writer().put(entity_->handle()).put(bytes));
    }

private:
    std::size_t count(const char* what) const {
        return static_cast<std::size_t>(volery::request(what, volery::Writer().put(entity_->handle())).integer());
    }
    node_interfaces::NodeState::SharedPtr node_;
    QoS qos_;
    std::shared_ptr<volery::Entity> entity_;
    std::vector<std::unique_ptr<volery::Entity>> events_;
};

// A message that its publisher has made, which is sent by moving it into publish().
template <class Message, class Allocator = std::allocator<void>>
class LoanedMessage {
public:
    LoanedMessage() : message_(std::make_unique<Message>()) {}
    bool is_valid() const { return message_ != nullptr; }
    Message& get() const { return *message_; }

private:
    std::unique_ptr<Message> message_;
};

template <class Message, class Allocator = std::allocator<void>>
class Publisher : public PublisherBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Publisher)
    using MessageUniquePtr = std::unique_ptr<Message>;
    using MessageSharedPtr = std::shared_ptr<const Message>;
    using PublishedType = Message;
    using ROSMessageType = Message;

    Publisher(const node_interfaces::NodeState::SharedPtr& node, const std::string& topic, const QoS& qos,
              const PublisherOptions& options)
        : PublisherBase(node, topic, Message::name_(), qos, options) {}

    virtual void publish(std::unique_ptr<Message> message) { publish(*message); }
    virtual void publish(const Message& message) { send(volery::to_bytes(message)); }
    void publish(const SerializedMessage& message) { send(message.bytes_in_cdr()); }
    void publish(LoanedMessage<Message, Allocator>&& message) { publish(message.get()); }
    LoanedMessage<Message, Allocator> borrow_loaned_message() { return {}; }
};

// Publishes messages of a type that is known when the node runs, in CDR.
class GenericPublisher : public PublisherBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(GenericPublisher)
    using PublisherBase::PublisherBase;
    void publish(const SerializedMessage& message) { send(message.bytes_in_cdr()); }
};

}  // namespace rclcpp
