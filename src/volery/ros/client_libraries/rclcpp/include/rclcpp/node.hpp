// rclcpp::Node and its options.
#pragma once
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "rclcpp/executor.hpp"
#include "rclcpp/logging.hpp"
#include "rclcpp/parameter.hpp"
#include "rclcpp/publisher.hpp"
#include "rclcpp/service.hpp"
#include "rclcpp/subscription.hpp"
#include "rclcpp/timer.hpp"

namespace rclcpp {

class NodeOptions {
public:
    NodeOptions& context(Context::SharedPtr) { return *this; }
    NodeOptions& arguments(std::vector<std::string> given) { return arguments_ = std::move(given), *this; }
    const std::vector<std::string>& arguments() const { return arguments_; }
    NodeOptions& parameter_overrides(std::vector<Parameter> given) { return overrides_ = std::move(given), *this; }
    const std::vector<Parameter>& parameter_overrides() const { return overrides_; }
    std::vector<Parameter>& parameter_overrides() { return overrides_; }
    template <class Value>
    NodeOptions& append_parameter_override(const std::string& name, const Value& value) {
        return overrides_.emplace_back(name, ParameterValue(value)), *this;
    }
    NodeOptions& use_global_arguments(bool use) { return global_ = use, *this; }
    bool use_global_arguments() const { return global_; }
    NodeOptions& allow_undeclared_parameters(bool allow) { return undeclared_ = allow, *this; }
    bool allow_undeclared_parameters() const { return undeclared_; }
    NodeOptions& automatically_declare_parameters_from_overrides(bool declare) { return automatic_ = declare, *this; }
    bool automatically_declare_parameters_from_overrides() const { return automatic_; }
    NodeOptions& start_parameter_services(bool start) { return services_ = start, *this; }
    bool start_parameter_services() const { return services_; }
    // These have no effect: messages are handed over in the same way within a process and between two.
    NodeOptions& use_intra_process_comms(bool use) { return intra_process_ = use, *this; }
    bool use_intra_process_comms() const { return intra_process_; }
    NodeOptions& enable_rosout(bool) { return *this; }
    NodeOptions& enable_topic_statistics(bool) { return *this; }
    NodeOptions& enable_logger_service(bool) { return *this; }
    NodeOptions& start_parameter_event_publisher(bool) { return *this; }
    NodeOptions& use_clock_thread(bool) { return *this; }
    NodeOptions& clock_type(rcl_clock_type_t) { return *this; }
    NodeOptions& clock_qos(const QoS&) { return *this; }
    NodeOptions& rosout_qos(const QoS&) { return *this; }
    NodeOptions& parameter_event_qos(const QoS&) { return *this; }

private:
    std::vector<std::string> arguments_;
    std::vector<Parameter> overrides_;
    bool global_ = true, undeclared_ = false, automatic_ = false, services_ = true, intra_process_ = false;
};

// Whether something has happened.
class Event {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Event)
    bool set() { return std::exchange(set_, true); }
    bool check() const { return set_; }
    bool check_and_clear() { return std::exchange(set_, false); }

private:
    bool set_ = false;
};

using SetParametersResult = rcl_interfaces::msg::SetParametersResult;
using VoidCallbackType = std::function<void()>;

namespace detail {

inline void put(volery::Writer& out, const std::vector<Parameter>& parameters) {
    out.put(parameters.size());
    for (const auto& one : parameters) out.put(volery::to_bytes(one.to_parameter_msg()));
}
inline std::vector<Parameter> parameters(volery::Reader& in) {
    std::vector<Parameter> all(static_cast<std::size_t>(in.integer()));
    for (auto& one : all) {
        auto const bytes = in.text();
        rcl_interfaces::msg::Parameter message;
        volery::from_bytes(volery::Reader(bytes.data(), bytes.size()), message);
        one = Parameter::from_parameter_msg(message);
    }
    return all;
}

// A callback about parameters, which is removed with its handle.
struct ParameterCallback {
    RCLCPP_SMART_PTR_DEFINITIONS(ParameterCallback)
    explicit ParameterCallback(std::int64_t number, std::int64_t callable) : entity(number, "", callable) {}
    volery::Entity entity;
};

}  // namespace detail

namespace node_interfaces {

using OnSetParametersCallbackHandle = detail::ParameterCallback;
using PreSetParametersCallbackHandle = detail::ParameterCallback;
using PostSetParametersCallbackHandle = detail::ParameterCallback;

// What a Node and a LifecycleNode have in common.
class NodeMembers {
public:
    using OnSetParametersCallbackType = std::function<SetParametersResult(const std::vector<Parameter>&)>;
    using OnParametersSetCallbackType = OnSetParametersCallbackType;
    using PreSetParametersCallbackType = std::function<void(std::vector<Parameter>&)>;
    using PostSetParametersCallbackType = std::function<void(const std::vector<Parameter>&)>;

    NodeMembers(const std::string& name, const std::string& ns, const NodeOptions& options)
        : options_(options), clock_(std::make_shared<Clock>(RCL_ROS_TIME)) {
        auto with = volery::Writer().put(name).put(ns).put(options.use_global_arguments());
        with.put(options.allow_undeclared_parameters()).put(options.automatically_declare_parameters_from_overrides());
        with.put(options.start_parameter_services());
        with.put(options.arguments().size());
        for (const auto& one : options.arguments()) with.put(one);
        detail::put(with, options.parameter_overrides());
        auto answer = detail::ask("ros.node", with);
        auto const number = answer.integer();
        auto const own = answer.text(), where = answer.text();
        state_ = std::make_shared<NodeState>(number, own, where, answer.integer());
    }

    // -- identity

    const char* get_name() const { return state_->get_name(); }
    const char* get_namespace() const { return state_->get_namespace(); }
    const char* get_effective_namespace() const { return get_namespace(); }
    const char* get_fully_qualified_name() const { return state_->get_fully_qualified_name(); }
    Logger get_logger() const { return Logger(state_->logger_name()); }
    Clock::SharedPtr get_clock() { return clock_; }
    Clock::ConstSharedPtr get_clock() const { return clock_; }
    Time now() const { return clock_->now(); }
    const NodeOptions& get_node_options() const { return options_; }
    NodeState::SharedPtr get_node_base_interface() const { return state_; }
    NodeState::SharedPtr get_node_clock_interface() const { return state_; }
    NodeState::SharedPtr get_node_graph_interface() const { return state_; }
    NodeState::SharedPtr get_node_logging_interface() const { return state_; }
    NodeState::SharedPtr get_node_parameters_interface() const { return state_; }
    NodeState::SharedPtr get_node_services_interface() const { return state_; }
    NodeState::SharedPtr get_node_timers_interface() const { return state_; }
    NodeState::SharedPtr get_node_topics_interface() const { return state_; }
    NodeState::SharedPtr get_node_waitables_interface() const { return state_; }
    NodeState::SharedPtr get_node_time_source_interface() const { return state_; }

    // -- entities

    CallbackGroup::SharedPtr create_callback_group(CallbackGroupType type, bool automatically_add_to_executor = true) {
        bool const exclusive = type == CallbackGroupType::MutuallyExclusive;
        auto const with = about().put(exclusive).put(automatically_add_to_executor);
        return std::make_shared<CallbackGroup>(volery::request("ros.group", with).integer(), type);
    }
    template <class Message, class Allocator = std::allocator<void>, class Made = Publisher<Message, Allocator>>
    std::shared_ptr<Made> create_publisher(const std::string& topic, const QoS& qos,
                                           const PublisherOptions& options = PublisherOptions()) {
        return std::make_shared<Made>(state_, topic, qos, options);
    }
    template <class Message, class Callback>
    std::shared_ptr<Subscription<Message>> create_subscription(const std::string& topic, const QoS& qos,
                                                               Callback&& callback,
                                                               const SubscriptionOptions& options = SubscriptionOptions(),
                                                               std::nullptr_t = nullptr) {
        return std::make_shared<Subscription<Message>>(state_, topic, qos, options, std::decay_t<Callback>(std::forward<Callback>(callback)));
    }
    GenericPublisher::SharedPtr create_generic_publisher(const std::string& topic, const std::string& type,
                                                         const QoS& qos,
                                                         const PublisherOptions& options = PublisherOptions()) {
        return std::make_shared<GenericPublisher>(state_, topic, type, qos, options);
    }
    template <class Callback>
    GenericSubscription::SharedPtr create_generic_subscription(const std::string& topic, const std::string& type,
                                                               const QoS& qos, Callback&& callback,
                                                               const SubscriptionOptions& options = SubscriptionOptions()) {
        return std::make_shared<GenericSubscription>(state_, topic, type, qos, options, std::decay_t<Callback>(std::forward<Callback>(callback)));
    }
    template <class Rep, class Period, class Callback>
    typename WallTimer<Callback>::SharedPtr create_wall_timer(std::chrono::duration<Rep, Period> period,
                                                              Callback callback,
                                                              CallbackGroup::SharedPtr group = nullptr,
                                                              bool autostart = true) {
        auto const span = std::chrono::duration_cast<std::chrono::nanoseconds>(period);
        return std::make_shared<WallTimer<Callback>>(state_, span, std::move(callback), group, autostart);
    }
    template <class Rep, class Period, class Callback>
    typename GenericTimer<Callback>::SharedPtr create_timer(std::chrono::duration<Rep, Period> period, Callback callback,
                                                            CallbackGroup::SharedPtr group = nullptr,
                                                            bool autostart = true) {
        auto const span = std::chrono::duration_cast<std::chrono::nanoseconds>(period);
        return std::make_shared<GenericTimer<Callback>>(state_, span, std::move(callback), group, autostart);
    }
    template <class Type, class Callback>
    typename Service<Type>::SharedPtr create_service(const std::string& name, Callback&& callback,
                                                     const QoS& = ServicesQoS(), CallbackGroup::SharedPtr group = nullptr) {
        auto const made = std::make_shared<Service<Type>>(state_, group);
        made->serve(name, std::decay_t<Callback>(std::forward<Callback>(callback)));
        return made;
    }
    template <class Type, class Callback>
    typename Service<Type>::SharedPtr create_service(const std::string& name, Callback&& callback,
                                                     const rmw_qos_profile_t&, CallbackGroup::SharedPtr group = nullptr) {
        return create_service<Type>(name, std::forward<Callback>(callback), ServicesQoS(), group);
    }
    template <class Type>
    typename Client<Type>::SharedPtr create_client(const std::string& name, const QoS& = ServicesQoS(),
                                                   CallbackGroup::SharedPtr group = nullptr) {
        return std::make_shared<Client<Type>>(state_, name, group);
    }
    template <class Type>
    typename Client<Type>::SharedPtr create_client(const std::string& name, const rmw_qos_profile_t&,
                                                   CallbackGroup::SharedPtr group = nullptr) {
        return std::make_shared<Client<Type>>(state_, name, group);
    }

    // -- parameters

    const ParameterValue& declare_parameter(const std::string& name, const ParameterValue& value,
                                            const rcl_interfaces::msg::ParameterDescriptor& descriptor = {},
                                            bool ignore_override = false) {
        return declare(name, value, PARAMETER_NOT_SET, descriptor, ignore_override);
    }
    const ParameterValue& declare_parameter(const std::string& name, ParameterType type,
                                            const rcl_interfaces::msg::ParameterDescriptor& descriptor = {},
                                            bool ignore_override = false) {
        return declare(name, ParameterValue(), type, descriptor, ignore_override);
    }
    template <class Value>
    auto declare_parameter(const std::string& name, const Value& value,
                           const rcl_interfaces::msg::ParameterDescriptor& descriptor = {}, bool ignore_override = false)
        -> decltype(ParameterValue(value), ParameterValue().get<Value>()) {
        return checked<Value>(name, declare(name, ParameterValue(value), PARAMETER_NOT_SET, descriptor, ignore_override));
    }
    template <class Value>
    auto declare_parameter(const std::string& name, const rcl_interfaces::msg::ParameterDescriptor& descriptor = {},
                           bool ignore_override = false) {
        constexpr auto type = ParameterValue::type_of<Value>();
        const auto& given = declare(name, ParameterValue(), type, descriptor, ignore_override);
        if (given.get_type() == PARAMETER_NOT_SET)
            throw exceptions::ParameterUninitializedException("parameter '" + name + "' is not initialized");
        return checked<Value>(name, given);
    }
    template <class Value>
    std::vector<Value> declare_parameters(const std::string& ns, const std::map<std::string, Value>& parameters,
                                          bool ignore_overrides = false) {
        std::vector<Value> all;
        for (const auto& [name, value] : parameters)
            all.push_back(declare_parameter(below(ns, name), value, {}, ignore_overrides));
        return all;
    }
    void undeclare_parameter(const std::string& name) { detail::ask("ros.param_undeclare", about().put(name)); }
    bool has_parameter(const std::string& name) const { return volery::request("ros.param_has", about().put(name)).flag(); }
    Parameter get_parameter(const std::string& name) const {
        auto answer = detail::ask("ros.param_get", about().put(name));
        return detail::parameters(answer).front();
    }
    // Return whether there is the parameter with a value; otherwise *value* is not changed.
    bool get_parameter(const std::string& name, Parameter& value) const {
        if (!has_parameter(name)) return false;
        value = get_parameter(name);
        return true;
    }
    template <class Value>
    bool get_parameter(const std::string& name, Value& value) const {
        Parameter found;
        if (!get_parameter(name, found) || found.get_type() == PARAMETER_NOT_SET) return false;
        value = static_cast<Value>(found.get_value<Value>());
        return true;
    }
    template <class Value>
    bool get_parameter_or(const std::string& name, Value& value, const Value& otherwise) const {
        if (get_parameter(name, value)) return true;
        value = otherwise;
        return false;
    }
    template <class Value>
    Value get_parameter_or(const std::string& name, const Value& otherwise) const {
        Value value = otherwise;
        get_parameter(name, value);
        return value;
    }
    std::vector<Parameter> get_parameters(const std::vector<std::string>& names) const {
        std::vector<Parameter> all;
        for (const auto& name : names) all.push_back(get_parameter(name));
        return all;
    }
    template <class Value>
    bool get_parameters(const std::string& prefix, std::map<std::string, Value>& values) const {
        auto const start = prefix.empty() ? "" : prefix + ".";
        bool any = false;
        for (const auto& name : list_parameters({}, 0).names) {
            if (name.compare(0, start.size(), start) != 0) continue;
            auto const found = get_parameter(name);
            if constexpr (std::is_same_v<Value, Parameter>)
                values[name.substr(start.size())] = found;
            else
                values[name.substr(start.size())] = found.get_value<Value>();
            any = true;
        }
        return any;
    }
    SetParametersResult set_parameter(const Parameter& parameter) { return set_parameters_atomically({parameter}); }
    std::vector<SetParametersResult> set_parameters(const std::vector<Parameter>& parameters) {
        std::vector<SetParametersResult> all;
        for (const auto& one : parameters) all.push_back(set_parameter(one));
        return all;
    }
    SetParametersResult set_parameters_atomically(const std::vector<Parameter>& parameters) {
        auto with = about();
        detail::put(with, parameters);
        return message<SetParametersResult>(detail::ask("ros.param_set", with));
    }
    rcl_interfaces::msg::ParameterDescriptor describe_parameter(const std::string& name) const {
        return message<rcl_interfaces::msg::ParameterDescriptor>(detail::ask("ros.param_describe", about().put(name)));
    }
    std::vector<rcl_interfaces::msg::ParameterDescriptor> describe_parameters(const std::vector<std::string>& names) const {
        std::vector<rcl_interfaces::msg::ParameterDescriptor> all;
        for (const auto& name : names) all.push_back(describe_parameter(name));
        return all;
    }
    std::vector<std::uint8_t> get_parameter_types(const std::vector<std::string>& names) const {
        std::vector<std::uint8_t> all;
        for (const auto& name : names) all.push_back(get_parameter(name).get_type());
        return all;
    }
    rcl_interfaces::msg::ListParametersResult list_parameters(const std::vector<std::string>& prefixes,
                                                              std::uint64_t depth) const {
        auto with = about().put(prefixes.size());
        for (const auto& one : prefixes) with.put(one);
        return message<rcl_interfaces::msg::ListParametersResult>(
            detail::ask("ros.param_list", with.put(static_cast<std::int64_t>(depth))));
    }
    // Callbacks that change what is to be set, accept or refuse it, or learn that it was set.
    std::shared_ptr<OnSetParametersCallbackHandle> add_on_set_parameters_callback(OnSetParametersCallbackType callback) {
        return call_about_parameters("on", [callback](volery::Reader in, volery::Writer& out) {
            out.put(volery::to_bytes(callback(detail::parameters(in))));
        });
    }
    std::shared_ptr<PreSetParametersCallbackHandle> add_pre_set_parameters_callback(PreSetParametersCallbackType callback) {
        return call_about_parameters("pre", [callback](volery::Reader in, volery::Writer& out) {
            auto all = detail::parameters(in);
            callback(all);
            detail::put(out, all);
        });
    }
    std::shared_ptr<PostSetParametersCallbackHandle> add_post_set_parameters_callback(PostSetParametersCallbackType callback) {
        return call_about_parameters("post", [callback](volery::Reader in, volery::Writer&) { callback(detail::parameters(in)); });
    }
    void remove_on_set_parameters_callback(const OnSetParametersCallbackHandle* handle) { remove(handle); }
    void remove_pre_set_parameters_callback(const PreSetParametersCallbackHandle* handle) { remove(handle); }
    void remove_post_set_parameters_callback(const PostSetParametersCallbackHandle* handle) { remove(handle); }
    // The older form, whose callback stays as long as the node.
    std::shared_ptr<OnSetParametersCallbackHandle> set_on_parameters_set_callback(OnSetParametersCallbackType callback) {
        return own_callback_ = add_on_set_parameters_callback(std::move(callback));
    }

    // -- the graph

    std::vector<std::string> get_node_names() const { return detail::texts(volery::request("ros.nodes")); }
    std::map<std::string, std::vector<std::string>> get_topic_names_and_types() const { return listed("ros.topics"); }
    std::map<std::string, std::vector<std::string>> get_service_names_and_types() const { return listed("ros.services"); }
    Event::SharedPtr get_graph_event() const { return std::make_shared<Event>(); }
    // Wait until a node, a topic or a service comes or goes.
    void wait_for_graph_change(const Event::SharedPtr& event, std::chrono::nanoseconds timeout) const {
        if (volery::request("ros.wait_for_graph_change", volery::Writer().put(timeout.count())).flag()) event->set();
    }
    std::size_t count_publishers(const std::string& topic) const { return count("ros.count_publishers", topic); }
    std::size_t count_subscribers(const std::string& topic) const { return count("ros.count_subscribers", topic); }

protected:
    ~NodeMembers() = default;
    volery::Writer about() const { return volery::Writer().put(state_->number()); }

private:
    static std::string below(const std::string& ns, const std::string& name) { return ns.empty() ? name : ns + "." + name; }
    template <class Value>
    static auto checked(const std::string& name, const ParameterValue& value) {
        try {
            return value.get<Value>();
        } catch (const ParameterTypeException& error) {
            throw exceptions::InvalidParameterTypeException("parameter '" + name + "' has invalid type: " + error.what());
        }
    }
    template <class Message>
    static Message message(volery::Reader answer) {
        Message made;
        auto const bytes = answer.text();
        volery::from_bytes(volery::Reader(bytes.data(), bytes.size()), made);
        return made;
    }
    const ParameterValue& declare(const std::string& name, const ParameterValue& value, ParameterType type,
                                  const rcl_interfaces::msg::ParameterDescriptor& descriptor, bool ignore_override) {
        auto with = about().put(name).put(volery::to_bytes(value.to_value_msg())).put(static_cast<int>(type));
        auto answer = detail::ask("ros.param_declare", with.put(volery::to_bytes(descriptor)).put(ignore_override));
        return declared_[name] = detail::parameters(answer).front().get_parameter_value();
    }
    std::shared_ptr<detail::ParameterCallback> call_about_parameters(const char* when, volery::Callable callback) {
        auto const callable = volery::register_callable(std::move(callback));
        auto const number = volery::request("ros.param_callback", about().put(when).put(callable)).integer();
        return std::make_shared<detail::ParameterCallback>(number, callable);
    }
    static void remove(const detail::ParameterCallback* handle) {
        if (handle != nullptr) const_cast<detail::ParameterCallback*>(handle)->entity.close();
    }
    static std::map<std::string, std::vector<std::string>> listed(const char* what) {
        auto answer = volery::request(what);
        std::map<std::string, std::vector<std::string>> all;
        for (auto left = answer.integer(); left > 0; --left) {
            auto const name = answer.text();
            all[name].push_back(answer.text());
        }
        return all;
    }
    std::size_t count(const char* what, const std::string& topic) const {
        return static_cast<std::size_t>(volery::request(what, about().put(topic)).integer());
    }

    NodeOptions options_;
    Clock::SharedPtr clock_;
    NodeState::SharedPtr state_;
    std::map<std::string, ParameterValue> declared_;
    std::shared_ptr<detail::ParameterCallback> own_callback_;
};

}  // namespace node_interfaces

class Node : public node_interfaces::NodeMembers, public std::enable_shared_from_this<Node> {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Node)
    using OnSetParametersCallbackHandle = node_interfaces::OnSetParametersCallbackHandle;
    using PreSetParametersCallbackHandle = node_interfaces::PreSetParametersCallbackHandle;
    using PostSetParametersCallbackHandle = node_interfaces::PostSetParametersCallbackHandle;
    explicit Node(const std::string& name, const NodeOptions& options = NodeOptions()) : Node(name, "", options) {}
    Node(const std::string& name, const std::string& ns, const NodeOptions& options = NodeOptions())
        : NodeMembers(name, ns, options) {}
    Node(const Node&) = delete;
    Node& operator=(const Node&) = delete;
    virtual ~Node() = default;
};

inline void Executor::add_node(std::shared_ptr<Node> node, bool notify) { add_node(node->get_node_base_interface(), notify); }
inline void Executor::remove_node(std::shared_ptr<Node> node, bool notify) {
    remove_node(node->get_node_base_interface(), notify);
}
inline void spin(std::shared_ptr<Node> node) { spin(node->get_node_base_interface()); }
inline void spin_some(std::shared_ptr<Node> node) { spin_some(node->get_node_base_interface()); }
inline void spin_all(std::shared_ptr<Node> node, std::chrono::nanoseconds longest) {
    spin_all(node->get_node_base_interface(), longest);
}

namespace detail {

// The node behind a node, a pointer to one or one of its interfaces.
inline node_interfaces::NodeState::SharedPtr state_of(const node_interfaces::NodeState::SharedPtr& state) { return state; }
template <class NodeType>
auto state_of(const NodeType& node) -> decltype(node->get_node_base_interface()) {
    return node->get_node_base_interface();
}
template <class NodeType>
auto state_of(const NodeType& node) -> decltype(node.get_node_base_interface()) {
    return node.get_node_base_interface();
}

}  // namespace detail

// -- the same as functions, of a node or of its interfaces

template <class Message, class NodeType>
std::shared_ptr<Publisher<Message>> create_publisher(NodeType&& node, const std::string& topic, const QoS& qos,
                                                     const PublisherOptions& options = PublisherOptions()) {
    return std::make_shared<Publisher<Message>>(detail::state_of(node), topic, qos, options);
}
template <class Message, class NodeType, class Callback>
std::shared_ptr<Subscription<Message>> create_subscription(NodeType&& node, const std::string& topic, const QoS& qos,
                                                           Callback&& callback,
                                                           const SubscriptionOptions& options = SubscriptionOptions()) {
    return std::make_shared<Subscription<Message>>(detail::state_of(node), topic, qos, options, std::decay_t<Callback>(std::forward<Callback>(callback)));
}
template <class NodeType, class Callback>
typename GenericTimer<Callback>::SharedPtr create_timer(const NodeType& node, Clock::SharedPtr, Duration period,
                                                        Callback callback, CallbackGroup::SharedPtr group = nullptr,
                                                        bool autostart = true) {
    auto const span = std::chrono::nanoseconds(period.nanoseconds());
    return std::make_shared<GenericTimer<Callback>>(detail::state_of(node), span, std::move(callback), group, autostart);
}
template <class Callback>
typename GenericTimer<Callback>::SharedPtr create_timer(node_interfaces::NodeState::SharedPtr node,
                                                        node_interfaces::NodeState::SharedPtr, Clock::SharedPtr clock,
                                                        Duration period, Callback callback,
                                                        CallbackGroup::SharedPtr group = nullptr) {
    return create_timer(node, clock, period, std::move(callback), group);
}
template <class Rep, class Period, class Callback>
typename WallTimer<Callback>::SharedPtr create_wall_timer(std::chrono::duration<Rep, Period> period, Callback callback,
                                                          CallbackGroup::SharedPtr group,
                                                          const node_interfaces::NodeState::SharedPtr& node,
                                                          const node_interfaces::NodeState::SharedPtr&,
                                                          bool autostart = true) {
    auto const span = std::chrono::duration_cast<std::chrono::nanoseconds>(period);
    return std::make_shared<WallTimer<Callback>>(node, span, std::move(callback), group, autostart);
}
template <class Type>
typename Client<Type>::SharedPtr create_client(const node_interfaces::NodeState::SharedPtr& node,
                                               const node_interfaces::NodeState::SharedPtr&,
                                               const node_interfaces::NodeState::SharedPtr&, const std::string& name,
                                               const QoS& = ServicesQoS(), CallbackGroup::SharedPtr group = nullptr) {
    return std::make_shared<Client<Type>>(node, name, group);
}
template <class Type, class Callback>
typename Service<Type>::SharedPtr create_service(const node_interfaces::NodeState::SharedPtr& node,
                                                 const node_interfaces::NodeState::SharedPtr&, const std::string& name,
                                                 Callback&& callback, const QoS& = ServicesQoS(),
                                                 CallbackGroup::SharedPtr group = nullptr) {
    auto const made = std::make_shared<Service<Type>>(node, group);
    made->serve(name, std::decay_t<Callback>(std::forward<Callback>(callback)));
    return made;
}

// Wait for the next message of a topic; return false after a time-out, of which a negative one means none.
template <class Message, class NodeType, class Rep = std::int64_t, class Period = std::milli>
bool wait_for_message(Message& into, NodeType&& node, const std::string& topic,
                      std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1),
                      const QoS& = SystemDefaultsQoS()) {
    auto const within = std::chrono::duration_cast<std::chrono::nanoseconds>(timeout).count();
    auto const with = volery::Writer().put(detail::state_of(node)->number()).put(topic).put(Message::name_()).put(within);
    auto answer = volery::request("ros.wait_for_message", with);
    if (!answer.flag()) return false;
    volery::from_bytes(answer, into);
    return true;
}

}  // namespace rclcpp
