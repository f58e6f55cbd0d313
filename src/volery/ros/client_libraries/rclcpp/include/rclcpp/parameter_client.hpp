// Clients of the parameters of other nodes, and callbacks about changes of parameters. The classes are templates, so
// that files which do not use them are compiled quickly.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "rcl_interfaces/srv/describe_parameters.hpp"
#include "rcl_interfaces/srv/get_parameter_types.hpp"
#include "rcl_interfaces/srv/get_parameters.hpp"
#include "rcl_interfaces/srv/list_parameters.hpp"
#include "rcl_interfaces/srv/set_parameters.hpp"
#include "rcl_interfaces/srv/set_parameters_atomically.hpp"
#include "rclcpp/node.hpp"

namespace rclcpp {

template <class = void>
class AsyncParametersClientOf {
    using GetParameters = rcl_interfaces::srv::GetParameters;
    using SetParameters = rcl_interfaces::srv::SetParameters;
    using SetAtomically = rcl_interfaces::srv::SetParametersAtomically;
    using ListParameters = rcl_interfaces::srv::ListParameters;
    using DescribeParameters = rcl_interfaces::srv::DescribeParameters;
    using GetTypes = rcl_interfaces::srv::GetParameterTypes;
    template <class Value>
    using Callback = std::function<void(std::shared_future<Value>)>;

public:
    RCLCPP_SMART_PTR_DEFINITIONS(AsyncParametersClientOf)
    using Parameters = std::vector<Parameter>;
    using Results = std::vector<rcl_interfaces::msg::SetParametersResult>;
    using Descriptors = std::vector<rcl_interfaces::msg::ParameterDescriptor>;

    template <class NodeType>
    explicit AsyncParametersClientOf(const NodeType& node, const std::string& remote = "", const QoS& = ParametersQoS(),
                                   CallbackGroup::SharedPtr group = nullptr)
        : node_(detail::state_of(node)) {
        auto const at = (remote.empty() ? std::string(node_->get_fully_qualified_name()) : remote) + "/";
        make(get_, at + "get_parameters", group);
        make(set_, at + "set_parameters", group);
        make(set_atomically_, at + "set_parameters_atomically", group);
        make(list_, at + "list_parameters", group);
        make(describe_, at + "describe_parameters", group);
        make(types_, at + "get_parameter_types", group);
    }

    std::shared_future<Parameters> get_parameters(const std::vector<std::string>& names, Callback<Parameters> callback = nullptr) {
        auto request = std::make_shared<GetParameters::Request>();
        request->names = names;
        return ask<Parameters>(*get_, request, callback, [names](const GetParameters::Response& response) {
            Parameters all;
            for (std::size_t index = 0; index < response.values.size(); ++index)
                all.emplace_back(names[index], ParameterValue(response.values[index]));
            return all;
        });
    }
    std::shared_future<Results> set_parameters(const Parameters& parameters, Callback<Results> callback = nullptr) {
        auto request = std::make_shared<SetParameters::Request>();
        for (const auto& one : parameters) request->parameters.push_back(one.to_parameter_msg());
        return ask<Results>(*set_, request, callback, [](const SetParameters::Response& response) { return response.results; });
    }
    std::shared_future<SetParametersResult> set_parameters_atomically(const Parameters& parameters,
                                                                      Callback<SetParametersResult> callback = nullptr) {
        auto request = std::make_shared<SetAtomically::Request>();
        for (const auto& one : parameters) request->parameters.push_back(one.to_parameter_msg());
        return ask<SetParametersResult>(*set_atomically_, request, callback,
                                        [](const SetAtomically::Response& response) { return response.result; });
    }
    std::shared_future<rcl_interfaces::msg::ListParametersResult> list_parameters(
        const std::vector<std::string>& prefixes, std::uint64_t depth,
        Callback<rcl_interfaces::msg::ListParametersResult> callback = nullptr) {
        auto request = std::make_shared<ListParameters::Request>();
        request->prefixes = prefixes;
        request->depth = depth;
        return ask<rcl_interfaces::msg::ListParametersResult>(
            *list_, request, callback, [](const ListParameters::Response& response) { return response.result; });
    }
    std::shared_future<Descriptors> describe_parameters(const std::vector<std::string>& names, Callback<Descriptors> callback = nullptr) {
        auto request = std::make_shared<DescribeParameters::Request>();
        request->names = names;
        return ask<Descriptors>(*describe_, request, callback,
                                [](const DescribeParameters::Response& response) { return response.descriptors; });
    }
    std::shared_future<std::vector<ParameterType>> get_parameter_types(const std::vector<std::string>& names,
                                                                       Callback<std::vector<ParameterType>> callback = nullptr) {
        auto request = std::make_shared<GetTypes::Request>();
        request->names = names;
        return ask<std::vector<ParameterType>>(*types_, request, callback, [](const GetTypes::Response& response) {
            std::vector<ParameterType> all;
            for (auto const one : response.types) all.push_back(static_cast<ParameterType>(one));
            return all;
        });
    }
    bool service_is_ready() const { return get_->service_is_ready() && set_->service_is_ready(); }
    template <class Rep = std::int64_t, class Period = std::milli>
    bool wait_for_service(std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) const {
        return get_->wait_for_service(timeout) && types_->wait_for_service(timeout);
    }
    template <class Function>
    std::shared_ptr<Subscription<rcl_interfaces::msg::ParameterEvent>> on_parameter_event(Function callback) {
        return on_parameter_event(node_, callback);
    }
    template <class NodeType, class Function>
    static std::shared_ptr<Subscription<rcl_interfaces::msg::ParameterEvent>> on_parameter_event(const NodeType& node, Function callback) {
        return create_subscription<rcl_interfaces::msg::ParameterEvent>(node, "/parameter_events", ParameterEventsQoS(), callback);
    }

private:
    template <class Type>
    void make(std::shared_ptr<Client<Type>>& into, const std::string& name, const CallbackGroup::SharedPtr& group) {
        into = std::make_shared<Client<Type>>(node_, name, group);
    }
    template <class Value, class Type, class Request, class Convert>
    std::shared_future<Value> ask(Client<Type>& client, const Request& request, const Callback<Value>& callback, Convert convert) {
        auto const promise = std::make_shared<std::promise<Value>>();
        auto const future = promise->get_future().share();
        client.async_send_request(request, [promise, future, callback, convert](typename Client<Type>::SharedFuture answer) {
            promise->set_value(convert(*answer.get()));
            if (callback) callback(future);
        });
        return future;
    }
    node_interfaces::NodeState::SharedPtr node_;
    std::shared_ptr<Client<GetParameters>> get_;
    std::shared_ptr<Client<SetParameters>> set_;
    std::shared_ptr<Client<SetAtomically>> set_atomically_;
    std::shared_ptr<Client<ListParameters>> list_;
    std::shared_ptr<Client<DescribeParameters>> describe_;
    std::shared_ptr<Client<GetTypes>> types_;
};

using AsyncParametersClient = AsyncParametersClientOf<>;

// The same, which spins until the answer is there.
template <class = void>
class SyncParametersClientOf {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(SyncParametersClientOf)
    template <class NodeType>
    explicit SyncParametersClientOf(const NodeType& node, const std::string& remote = "", const QoS& qos = ParametersQoS())
        : SyncParametersClientOf(std::make_shared<executors::SingleThreadedExecutor>(), node, remote, qos) {}
    template <class NodeType>
    SyncParametersClientOf(Executor::SharedPtr executor, const NodeType& node, const std::string& remote = "", const QoS& qos = ParametersQoS())
        : executor_(std::move(executor)), node_(detail::state_of(node)), client_(node_, remote, qos) {}

    template <class Rep = std::int64_t, class Period = std::milli>
    std::vector<Parameter> get_parameters(const std::vector<std::string>& names,
                                          std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) {
        return answer(client_.get_parameters(names), timeout);
    }
    template <class Value>
    Value get_parameter(const std::string& name) {
        auto const found = get_parameters({name});
        if (found.size() != 1 || found[0].get_type() == PARAMETER_NOT_SET)
            throw std::runtime_error("Parameter '" + name + "' is not set");
        return found[0].template get_value<Value>();
    }
    template <class Value>
    Value get_parameter(const std::string& name, const Value& otherwise) {
        auto const found = get_parameters({name});
        return found.size() != 1 || found[0].get_type() == PARAMETER_NOT_SET ? otherwise : found[0].template get_value<Value>();
    }
    bool has_parameter(const std::string& name) {
        auto const found = list_parameters({name}, 1).names;
        return std::find(found.begin(), found.end(), name) != found.end();
    }
    std::vector<rcl_interfaces::msg::SetParametersResult> set_parameters(const std::vector<Parameter>& parameters) {
        return answer(client_.set_parameters(parameters), NONE);
    }
    SetParametersResult set_parameters_atomically(const std::vector<Parameter>& parameters) {
        return answer(client_.set_parameters_atomically(parameters), NONE);
    }
    rcl_interfaces::msg::ListParametersResult list_parameters(const std::vector<std::string>& prefixes, std::uint64_t depth) {
        return answer(client_.list_parameters(prefixes, depth), NONE);
    }
    std::vector<rcl_interfaces::msg::ParameterDescriptor> describe_parameters(const std::vector<std::string>& names) {
        return answer(client_.describe_parameters(names), NONE);
    }
    std::vector<ParameterType> get_parameter_types(const std::vector<std::string>& names) {
        return answer(client_.get_parameter_types(names), NONE);
    }
    bool service_is_ready() const { return client_.service_is_ready(); }
    template <class Rep = std::int64_t, class Period = std::milli>
    bool wait_for_service(std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) const {
        return client_.wait_for_service(timeout);
    }
    template <class Function>
    auto on_parameter_event(Function callback) {
        return client_.on_parameter_event(callback);
    }
    template <class NodeType, class Function>
    static auto on_parameter_event(const NodeType& node, Function callback) {
        return AsyncParametersClient::on_parameter_event(node, callback);
    }

private:
    static constexpr std::chrono::nanoseconds NONE{-1};
    template <class Value, class Span>
    Value answer(std::shared_future<Value> future, Span timeout) {
        auto const code = executors::spin_node_until_future_complete(*executor_, node_, future, timeout);
        if (code != FutureReturnCode::SUCCESS) return Value();
        return future.get();
    }
    Executor::SharedPtr executor_;
    node_interfaces::NodeState::SharedPtr node_;
    AsyncParametersClient client_;
};

using SyncParametersClient = SyncParametersClientOf<>;

struct ParameterCallbackHandle {
    RCLCPP_SMART_PTR_DEFINITIONS(ParameterCallbackHandle)
    std::string parameter, node;
    std::function<void(const Parameter&)> callback;
};
struct ParameterEventCallbackHandle {
    RCLCPP_SMART_PTR_DEFINITIONS(ParameterEventCallbackHandle)
    std::function<void(const rcl_interfaces::msg::ParameterEvent&)> callback;
};

// Calls back when parameters of any node change; a callback ends with its handle.
template <class = void>
class ParameterEventHandlerOf {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(ParameterEventHandlerOf)
    template <class NodeType>
    explicit ParameterEventHandlerOf(const NodeType& node, const QoS& qos = ParameterEventsQoS()) : node_(detail::state_of(node)) {
        events_ = create_subscription<rcl_interfaces::msg::ParameterEvent>(
            node_, "/parameter_events", qos, [this](const rcl_interfaces::msg::ParameterEvent& event) { handle(event); });
    }
    [[nodiscard]] ParameterCallbackHandle::SharedPtr add_parameter_callback(
        const std::string& parameter, std::function<void(const Parameter&)> callback, const std::string& node = "") {
        auto const full = node.empty() ? std::string(node_->get_fully_qualified_name()) : node.front() == '/' ? node : "/" + node;
        auto const made = std::make_shared<ParameterCallbackHandle>(ParameterCallbackHandle{parameter, full, std::move(callback)});
        parameters_.push_back(made);
        return made;
    }
    void remove_parameter_callback(const ParameterCallbackHandle::SharedPtr& handle) { handle->callback = nullptr; }
    [[nodiscard]] ParameterEventCallbackHandle::SharedPtr add_parameter_event_callback(
        std::function<void(const rcl_interfaces::msg::ParameterEvent&)> callback) {
        auto const made = std::make_shared<ParameterEventCallbackHandle>(ParameterEventCallbackHandle{std::move(callback)});
        all_.push_back(made);
        return made;
    }
    void remove_parameter_event_callback(const ParameterEventCallbackHandle::SharedPtr& handle) { handle->callback = nullptr; }

    // Get a parameter of an event; return false if the event is not about it.
    static bool get_parameter_from_event(const rcl_interfaces::msg::ParameterEvent& event, Parameter& parameter,
                                         const std::string& name, const std::string& node = "") {
        if (event.node != node) return false;
        for (const auto& one : get_parameters_from_event(event))
            if (one.get_name() == name) return parameter = one, true;
        return false;
    }
    static std::vector<Parameter> get_parameters_from_event(const rcl_interfaces::msg::ParameterEvent& event) {
        std::vector<Parameter> all;
        for (const auto& one : event.new_parameters) all.push_back(Parameter::from_parameter_msg(one));
        for (const auto& one : event.changed_parameters) all.push_back(Parameter::from_parameter_msg(one));
        return all;
    }

private:
    void handle(const rcl_interfaces::msg::ParameterEvent& event) {
        for (const auto& one : std::vector(parameters_)) {
            auto const handle = one.lock();
            Parameter found;
            if (handle && handle->callback && get_parameter_from_event(event, found, handle->parameter, handle->node))
                handle->callback(found);
        }
        for (const auto& one : std::vector(all_)) {
            auto const handle = one.lock();
            if (handle && handle->callback) handle->callback(event);
        }
    }
    node_interfaces::NodeState::SharedPtr node_;
    std::vector<std::weak_ptr<ParameterCallbackHandle>> parameters_;
    std::vector<std::weak_ptr<ParameterEventCallbackHandle>> all_;
    std::shared_ptr<Subscription<rcl_interfaces::msg::ParameterEvent>> events_;
};
using ParameterEventHandler = ParameterEventHandlerOf<>;

}  // namespace rclcpp
