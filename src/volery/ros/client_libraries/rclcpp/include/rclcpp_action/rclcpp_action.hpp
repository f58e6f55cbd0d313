// rclcpp_action: clients and servers of actions, built of services and topics as in ROS 2.
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "action_msgs/msg/goal_info.hpp"
#include "action_msgs/msg/goal_status.hpp"
#include "action_msgs/msg/goal_status_array.hpp"
#include "action_msgs/srv/cancel_goal.hpp"
#include "rclcpp/rclcpp.hpp"

namespace rclcpp_action {

using GoalUUID = std::array<std::uint8_t, 16>;
using GoalInfo = action_msgs::msg::GoalInfo;
using GoalStatus = action_msgs::msg::GoalStatus;
using CancelGoal = action_msgs::srv::CancelGoal;
using CancelRequest = CancelGoal::Request;
using CancelResponseMessage = CancelGoal::Response;

enum class GoalResponse : std::int8_t { REJECT = 1, ACCEPT_AND_EXECUTE = 2, ACCEPT_AND_DEFER = 3 };
enum class CancelResponse : std::int8_t { REJECT = 1, ACCEPT = 2 };
enum class ResultCode : std::int8_t {
    UNKNOWN = GoalStatus::STATUS_UNKNOWN,
    SUCCEEDED = GoalStatus::STATUS_SUCCEEDED,
    CANCELED = GoalStatus::STATUS_CANCELED,
    ABORTED = GoalStatus::STATUS_ABORTED
};

inline std::string to_string(const GoalUUID& id) {
    std::ostringstream out;
    for (auto const byte : id) out << std::hex << static_cast<int>(byte);
    return out.str();
}

namespace exceptions {
struct UnknownGoalHandleError : std::invalid_argument {
    UnknownGoalHandleError() : std::invalid_argument("Goal handle is not known to this client.") {}
};
struct UnawareGoalHandleError : std::runtime_error {
    explicit UnawareGoalHandleError(const std::string& text = "Goal handle is not tracking the goal result.")
        : std::runtime_error(text) {}
};
}  // namespace exceptions

namespace detail {

inline GoalUUID new_id() {
    static std::uint64_t count = 0;
    GoalUUID id{};
    std::uint64_t value = ++count;
    auto const time = static_cast<std::uint64_t>(volery::request("ros.now").integer());
    for (std::size_t index = 0; index < 8; ++index) {
        id[index] = static_cast<std::uint8_t>(time >> (8 * index));
        id[8 + index] = static_cast<std::uint8_t>(value >> (8 * index));
    }
    return id;
}
template <class Message>
void set_id(Message& message, const GoalUUID& id) {
    std::copy(id.begin(), id.end(), message.goal_id.uuid.begin());
}
template <class Message>
GoalUUID id_of(const Message& message) {
    GoalUUID id;
    std::copy(message.goal_id.uuid.begin(), message.goal_id.uuid.end(), id.begin());
    return id;
}
inline bool ended(std::int8_t status) { return status >= GoalStatus::STATUS_SUCCEEDED; }

}  // namespace detail

// -- servers

class ServerBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(ServerBase)
    virtual ~ServerBase() = default;
};

template <class Action>
class Server;

// A goal on the side of the server.
template <class Action>
class ServerGoalHandle {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(ServerGoalHandle)
    using Goal = typename Action::Goal;
    using Result = typename Action::Result;
    using Feedback = typename Action::Feedback;

    ServerGoalHandle(std::weak_ptr<typename Server<Action>::State> server, const GoalUUID& id,
                     std::shared_ptr<const Goal> goal, const builtin_interfaces::msg::Time& stamp)
        : server_(std::move(server)), id_(id), goal_(std::move(goal)), stamp_(stamp) {}

    std::shared_ptr<const Goal> get_goal() const { return goal_; }
    const GoalUUID& get_goal_id() const { return id_; }
    bool is_canceling() const { return status_ == GoalStatus::STATUS_CANCELING; }
    bool is_active() const { return !detail::ended(status_); }
    bool is_executing() const { return status_ == GoalStatus::STATUS_EXECUTING; }
    void publish_feedback(std::shared_ptr<Feedback> feedback) {
        typename Action::Impl::FeedbackMessage message;
        detail::set_id(message, id_);
        message.feedback = *feedback;
        if (auto const server = server_.lock()) server->feedback->publish(message);
    }
    void succeed(typename Result::SharedPtr result) { end(GoalStatus::STATUS_SUCCEEDED, result); }
    void abort(typename Result::SharedPtr result) { end(GoalStatus::STATUS_ABORTED, result); }
    void canceled(typename Result::SharedPtr result) {
        if (!is_canceling()) refuse("canceled");
        end(GoalStatus::STATUS_CANCELED, result);
    }
    void execute() {
        if (status_ != GoalStatus::STATUS_ACCEPTED && !is_canceling()) refuse("execute");
        if (!is_canceling()) set(GoalStatus::STATUS_EXECUTING);
    }

private:
    friend struct Server<Action>::State;
    void end(std::int8_t status, const typename Result::SharedPtr& result) {
        if (!is_executing() && !is_canceling()) refuse("end");
        status_ = status;
        if (auto const server = server_.lock()) {
            server->publish_status();
            server->answer(*this, *result);
        }
    }
    void set(std::int8_t status) {
        status_ = status;
        if (auto const server = server_.lock()) server->publish_status();
    }
    [[noreturn]] void refuse(const char* what) const {
        throw std::runtime_error("goal_handle attempted invalid transition from state " + std::to_string(status_) +
                                 " with event " + what);
    }
    std::weak_ptr<typename Server<Action>::State> server_;
    GoalUUID id_;
    std::shared_ptr<const Goal> goal_;
    builtin_interfaces::msg::Time stamp_;
    std::int8_t status_ = GoalStatus::STATUS_ACCEPTED;
};

template <class Action>
class Server : public ServerBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Server)
    using Handle = ServerGoalHandle<Action>;
    using GoalCallback = std::function<GoalResponse(const GoalUUID&, std::shared_ptr<const typename Action::Goal>)>;
    using CancelCallback = std::function<CancelResponse(std::shared_ptr<Handle>)>;
    using AcceptedCallback = std::function<void(std::shared_ptr<Handle>)>;

    Server(const rclcpp::node_interfaces::NodeState::SharedPtr& node, const std::string& name, GoalCallback on_goal,
           CancelCallback on_cancel, AcceptedCallback on_accepted, const rclcpp::CallbackGroup::SharedPtr& group)
        : state_(std::make_shared<State>()) {
        auto const at = name + "/_action/";
        auto const state = state_;
        state->on_goal = std::move(on_goal);
        state->on_cancel = std::move(on_cancel);
        state->on_accepted = std::move(on_accepted);
        state->feedback = rclcpp::create_publisher<Feedback>(node, at + "feedback", 10);
        state->statuses = rclcpp::create_publisher<action_msgs::msg::GoalStatusArray>(node, at + "status", rclcpp::QoS(1).transient_local());
        std::weak_ptr<State> const weak = state;
        goals_ = make<SendGoal>(node, group, at + "send_goal", [weak](auto service, auto id, auto request) {
            if (auto const state = weak.lock()) state->accept(service, *id, *request);
        });
        cancels_ = make<CancelGoal>(node, group, at + "cancel_goal", [weak](auto service, auto id, auto request) {
            if (auto const state = weak.lock()) state->cancel(service, *id, *request);
        });
        state->results = make<GetResult>(node, group, at + "get_result", [weak](auto service, auto id, auto request) {
            if (auto const state = weak.lock()) state->result(service, *id, detail::id_of(*request));
        });
    }

private:
    using SendGoal = typename Action::Impl::SendGoalService;
    using GetResult = typename Action::Impl::GetResultService;
    using Feedback = typename Action::Impl::FeedbackMessage;
    friend class ServerGoalHandle<Action>;

    template <class Type, class Callback>
    static std::shared_ptr<rclcpp::Service<Type>> make(const rclcpp::node_interfaces::NodeState::SharedPtr& node,
                                                       const rclcpp::CallbackGroup::SharedPtr& group,
                                                       const std::string& name, Callback callback) {
        using Deferred = std::function<void(std::shared_ptr<rclcpp::Service<Type>>, std::shared_ptr<rmw_request_id_t>,
                                            std::shared_ptr<typename Type::Request>)>;
        auto const made = std::make_shared<rclcpp::Service<Type>>(node, group);
        made->serve(name, Deferred(callback));
        return made;
    }

public:
    // What goals share with their server. It ends with the server; the handles of goals only look at it.
    struct State : std::enable_shared_from_this<State> {
        GoalCallback on_goal;
        CancelCallback on_cancel;
        AcceptedCallback on_accepted;
        std::shared_ptr<rclcpp::Publisher<Feedback>> feedback;
        std::shared_ptr<rclcpp::Publisher<action_msgs::msg::GoalStatusArray>> statuses;
        std::shared_ptr<rclcpp::Service<GetResult>> results;
        std::map<GoalUUID, std::shared_ptr<Handle>> goals;
        std::map<GoalUUID, typename GetResult::Response> ended;
        std::multimap<GoalUUID, rmw_request_id_t> asked;

        template <class Service>
        void accept(const Service& service, rmw_request_id_t id, const typename SendGoal::Request& request) {
            auto const goal = std::make_shared<typename Action::Goal>(request.goal);
            auto const goal_id = detail::id_of(request);
            auto const answer = on_goal(goal_id, goal);
            typename SendGoal::Response response;
            response.accepted = answer != GoalResponse::REJECT;
            response.stamp = rclcpp::Clock(RCL_ROS_TIME).now();
            std::shared_ptr<Handle> handle;
            if (response.accepted) {
                handle = std::make_shared<Handle>(this->weak_from_this(), goal_id, goal, response.stamp);
                goals[goal_id] = handle;
            }
            service->send_response(id, response);
            if (!handle) return;
            publish_status();
            if (answer == GoalResponse::ACCEPT_AND_EXECUTE) handle->execute();
            on_accepted(handle);
        }
        template <class Service>
        void cancel(const Service& service, rmw_request_id_t id, const CancelRequest& request) {
            auto const wanted = detail::id_of(request.goal_info);
            auto const until = rclcpp::Time(request.goal_info.stamp).nanoseconds();
            bool const all = wanted == GoalUUID{} && until == 0;
            CancelResponseMessage response;
            auto const known = goals.find(wanted);
            if (wanted != GoalUUID{} && until == 0 && known == goals.end())
                response.return_code = CancelResponseMessage::ERROR_UNKNOWN_GOAL_ID;
            else if (known != goals.end() && until == 0 && !known->second->is_active())
                response.return_code = CancelResponseMessage::ERROR_GOAL_TERMINATED;
            auto const before = goals;
            for (const auto& [goal_id, handle] : before) {
                bool const chosen = all || goal_id == wanted || (until != 0 && rclcpp::Time(handle->stamp_).nanoseconds() <= until);
                if (!chosen || !handle->is_active() || handle->is_canceling()) continue;
                if (on_cancel(handle) != CancelResponse::ACCEPT || !handle->is_active()) continue;
                handle->set(GoalStatus::STATUS_CANCELING);
                GoalInfo info;
                detail::set_id(info, goal_id);
                info.stamp = handle->stamp_;
                response.goals_canceling.push_back(info);
            }
            if (response.return_code == 0 && response.goals_canceling.empty())
                response.return_code = CancelResponseMessage::ERROR_REJECTED;
            service->send_response(id, response);
        }
        template <class Service>
        void result(const Service& service, rmw_request_id_t id, const GoalUUID& goal_id) {
            auto const found = ended.find(goal_id);
            if (found != ended.end() || goals.count(goal_id) == 0) {
                auto response = found != ended.end() ? found->second : typename GetResult::Response();
                service->send_response(id, response);
            } else {
                asked.emplace(goal_id, id);
            }
        }
        void answer(const Handle& handle, const typename Action::Result& result) {
            auto& response = ended[handle.id_];
            response.status = handle.status_;
            response.result = result;
            auto const [first, last] = asked.equal_range(handle.id_);
            for (auto one = first; one != last; ++one) results->send_response(one->second, response);
            asked.erase(first, last);
        }
        void publish_status() {
            action_msgs::msg::GoalStatusArray message;
            for (const auto& [goal_id, handle] : goals) {
                GoalStatus one;
                detail::set_id(one.goal_info, goal_id);
                one.goal_info.stamp = handle->stamp_;
                one.status = handle->status_;
                message.status_list.push_back(one);
            }
            statuses->publish(message);
        }
    };

private:
    std::shared_ptr<State> state_;
    std::shared_ptr<rclcpp::Service<SendGoal>> goals_;
    std::shared_ptr<rclcpp::Service<CancelGoal>> cancels_;
};

// -- clients

class ClientBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(ClientBase)
    virtual ~ClientBase() = default;
};

template <class Action>
class Client;

// A goal on the side of the client.
template <class Action>
class ClientGoalHandle {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(ClientGoalHandle)
    using Result = typename Action::Result;
    using Feedback = typename Action::Feedback;
    struct WrappedResult {
        GoalUUID goal_id;
        ResultCode code;
        typename Result::SharedPtr result;
    };
    using FeedbackCallback = std::function<void(SharedPtr, std::shared_ptr<const Feedback>)>;
    using ResultCallback = std::function<void(const WrappedResult&)>;

    ClientGoalHandle(const GoalUUID& id, const rclcpp::Time& stamp, FeedbackCallback on_feedback, ResultCallback on_result)
        : id_(id), stamp_(stamp), on_feedback_(std::move(on_feedback)), on_result_(std::move(on_result)),
          future_(promise_.get_future().share()) {}
    const GoalUUID& get_goal_id() const { return id_; }
    rclcpp::Time get_goal_stamp() const { return stamp_; }
    std::int8_t get_status() const { return status_; }
    bool is_feedback_aware() const { return on_feedback_ != nullptr; }
    bool is_result_aware() const { return asked_; }

private:
    friend class Client<Action>;
    GoalUUID id_;
    rclcpp::Time stamp_;
    FeedbackCallback on_feedback_;
    ResultCallback on_result_;
    std::promise<WrappedResult> promise_;
    std::shared_future<WrappedResult> future_;
    std::int8_t status_ = GoalStatus::STATUS_ACCEPTED;
    bool asked_ = false;
};

template <class Action>
class Client : public ClientBase {
    using SendGoal = typename Action::Impl::SendGoalService;
    using GetResult = typename Action::Impl::GetResultService;
    using FeedbackMessage = typename Action::Impl::FeedbackMessage;

public:
    RCLCPP_SMART_PTR_DEFINITIONS(Client)
    using Goal = typename Action::Goal;
    using Feedback = typename Action::Feedback;
    using GoalHandle = ClientGoalHandle<Action>;
    using WrappedResult = typename GoalHandle::WrappedResult;
    // Called with the handle, of which null means that the goal was rejected. Older code takes its future.
    using GoalResponseCallback = std::function<void(typename GoalHandle::SharedPtr)>;
    using FeedbackCallback = typename GoalHandle::FeedbackCallback;
    using ResultCallback = typename GoalHandle::ResultCallback;
    using CancelRequest = CancelGoal::Request;
    using CancelResponse = CancelGoal::Response;
    using CancelCallback = std::function<void(CancelResponse::SharedPtr)>;
    struct SendGoalOptions {
        GoalResponseCallback goal_response_callback;
        FeedbackCallback feedback_callback;
        ResultCallback result_callback;
    };

    Client(const rclcpp::node_interfaces::NodeState::SharedPtr& node, const std::string& name,
           const rclcpp::CallbackGroup::SharedPtr& group)
        : state_(std::make_shared<State>()) {
        auto const at = name + "/_action/";
        goals_ = std::make_shared<rclcpp::Client<SendGoal>>(node, at + "send_goal", group);
        cancels_ = std::make_shared<rclcpp::Client<CancelGoal>>(node, at + "cancel_goal", group);
        results_ = std::make_shared<rclcpp::Client<GetResult>>(node, at + "get_result", group);
        rclcpp::SubscriptionOptions options;
        options.callback_group = group;
        feedback_ = rclcpp::create_subscription<FeedbackMessage>(
            node, at + "feedback", 10, [state = state_](std::shared_ptr<FeedbackMessage> message) {
                auto const handle = state->find(detail::id_of(*message));
                if (handle && handle->on_feedback_)
                    handle->on_feedback_(handle, std::make_shared<Feedback>(message->feedback));
            }, options);
        statuses_ = rclcpp::create_subscription<action_msgs::msg::GoalStatusArray>(
            node, at + "status", rclcpp::QoS(1).transient_local(),
            [state = state_](const action_msgs::msg::GoalStatusArray& message) {
                for (const auto& one : message.status_list) {
                    auto const handle = state->find(detail::id_of(one.goal_info));
                    if (handle && !detail::ended(handle->status_)) handle->status_ = one.status;
                }
            }, options);
    }

    bool action_server_is_ready() const { return goals_->service_is_ready() && results_->service_is_ready(); }
    template <class Rep = std::int64_t, class Period = std::milli>
    bool wait_for_action_server(std::chrono::duration<Rep, Period> timeout = std::chrono::duration<Rep, Period>(-1)) const {
        return goals_->wait_for_service(timeout) && results_->wait_for_service(timeout);
    }
    std::shared_future<typename GoalHandle::SharedPtr> async_send_goal(const Goal& goal,
                                                                       const SendGoalOptions& options = SendGoalOptions()) {
        auto const promise = std::make_shared<std::promise<typename GoalHandle::SharedPtr>>();
        auto const future = promise->get_future().share();
        auto const request = std::make_shared<typename SendGoal::Request>();
        auto const id = detail::new_id();
        detail::set_id(*request, id);
        request->goal = goal;
        goals_->async_send_request(request, [this, promise, id, options](typename rclcpp::Client<SendGoal>::SharedFuture answer) {
            auto const response = answer.get();
            typename GoalHandle::SharedPtr handle;
            if (response->accepted) {
                auto const stamp = rclcpp::Time(response->stamp);
                handle = std::make_shared<GoalHandle>(id, stamp, options.feedback_callback, options.result_callback);
                state_->handles[id] = handle;
            }
            promise->set_value(handle);
            if (options.goal_response_callback) options.goal_response_callback(handle);
            if (handle && options.result_callback) ask_for_result(handle);
        });
        return future;
    }
    std::shared_future<WrappedResult> async_get_result(typename GoalHandle::SharedPtr handle,
                                                       ResultCallback callback = nullptr) {
        check(handle);
        if (callback) handle->on_result_ = std::move(callback);
        ask_for_result(handle);
        return handle->future_;
    }
    std::shared_future<CancelResponse::SharedPtr> async_cancel_goal(typename GoalHandle::SharedPtr handle,
                                                                    CancelCallback callback = nullptr) {
        check(handle);
        auto request = std::make_shared<CancelRequest>();
        detail::set_id(request->goal_info, handle->id_);
        return cancel(request, callback);
    }
    std::shared_future<CancelResponse::SharedPtr> async_cancel_all_goals(CancelCallback callback = nullptr) {
        return cancel(std::make_shared<CancelRequest>(), callback);
    }
    std::shared_future<CancelResponse::SharedPtr> async_cancel_goals_before(const rclcpp::Time& stamp,
                                                                            CancelCallback callback = nullptr) {
        auto request = std::make_shared<CancelRequest>();
        request->goal_info.stamp = stamp;
        return cancel(request, callback);
    }
    void stop_callbacks(typename GoalHandle::SharedPtr handle) {
        handle->on_feedback_ = nullptr;
        handle->on_result_ = nullptr;
    }

private:
    struct State {
        std::map<GoalUUID, std::weak_ptr<GoalHandle>> handles;
        typename GoalHandle::SharedPtr find(const GoalUUID& id) const {
            auto const found = handles.find(id);
            return found == handles.end() ? nullptr : found->second.lock();
        }
    };

    void check(const typename GoalHandle::SharedPtr& handle) const {
        if (!handle || state_->find(handle->id_) != handle) throw exceptions::UnknownGoalHandleError();
    }
    void ask_for_result(const typename GoalHandle::SharedPtr& handle) {
        if (std::exchange(handle->asked_, true)) return;
        auto const request = std::make_shared<typename GetResult::Request>();
        detail::set_id(*request, handle->id_);
        results_->async_send_request(request, [handle](typename rclcpp::Client<GetResult>::SharedFuture answer) {
            auto const response = answer.get();
            handle->status_ = response->status;
            auto const result = std::make_shared<typename Action::Result>(response->result);
            WrappedResult const wrapped{handle->id_, static_cast<ResultCode>(response->status), result};
            handle->promise_.set_value(wrapped);
            if (handle->on_result_) handle->on_result_(wrapped);
        });
    }
    std::shared_future<CancelResponse::SharedPtr> cancel(const CancelRequest::SharedPtr& request, const CancelCallback& callback) {
        return cancels_->async_send_request(request, [callback](rclcpp::Client<CancelGoal>::SharedFuture answer) {
            if (callback) callback(answer.get());
        }).future;
    }

    std::shared_ptr<State> state_;
    std::shared_ptr<rclcpp::Client<SendGoal>> goals_;
    std::shared_ptr<rclcpp::Client<CancelGoal>> cancels_;
    std::shared_ptr<rclcpp::Client<GetResult>> results_;
    std::shared_ptr<rclcpp::Subscription<FeedbackMessage>> feedback_;
    std::shared_ptr<rclcpp::Subscription<action_msgs::msg::GoalStatusArray>> statuses_;
};

// -- of a node or of its interfaces

struct ServerOptions {};

template <class Action, class NodeType>
typename Server<Action>::SharedPtr create_server(NodeType&& node, const std::string& name,
                                                 typename Server<Action>::GoalCallback on_goal,
                                                 typename Server<Action>::CancelCallback on_cancel,
                                                 typename Server<Action>::AcceptedCallback on_accepted,
                                                 const ServerOptions& = ServerOptions(),
                                                 rclcpp::CallbackGroup::SharedPtr group = nullptr) {
    return std::make_shared<Server<Action>>(rclcpp::detail::state_of(node), name, on_goal, on_cancel, on_accepted, group);
}
template <class Action, class State>
typename Server<Action>::SharedPtr create_server(std::shared_ptr<State> base, std::shared_ptr<State>,
                                                 std::shared_ptr<State>, std::shared_ptr<State>, const std::string& name,
                                                 typename Server<Action>::GoalCallback on_goal,
                                                 typename Server<Action>::CancelCallback on_cancel,
                                                 typename Server<Action>::AcceptedCallback on_accepted) {
    return std::make_shared<Server<Action>>(base, name, on_goal, on_cancel, on_accepted, nullptr);
}
template <class Action, class NodeType>
typename Client<Action>::SharedPtr create_client(NodeType&& node, const std::string& name,
                                                 rclcpp::CallbackGroup::SharedPtr group = nullptr) {
    return std::make_shared<Client<Action>>(rclcpp::detail::state_of(node), name, group);
}
template <class Action, class State>
typename Client<Action>::SharedPtr create_client(std::shared_ptr<State> base, std::shared_ptr<State>,
                                                 std::shared_ptr<State>, std::shared_ptr<State>, const std::string& name,
                                                 rclcpp::CallbackGroup::SharedPtr group = nullptr) {
    return std::make_shared<Client<Action>>(base, name, group);
}

}  // namespace rclcpp_action
