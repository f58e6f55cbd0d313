// rclcpp_lifecycle: nodes whose states others change by services.
#pragma once
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "lifecycle_msgs/msg/state.hpp"
#include "lifecycle_msgs/msg/transition.hpp"
#include "lifecycle_msgs/msg/transition_event.hpp"
#include "lifecycle_msgs/srv/change_state.hpp"
#include "lifecycle_msgs/srv/get_available_states.hpp"
#include "lifecycle_msgs/srv/get_available_transitions.hpp"
#include "lifecycle_msgs/srv/get_state.hpp"
#include "rclcpp/rclcpp.hpp"

namespace rclcpp_lifecycle {

class State {
public:
    State() = default;
    State(std::uint8_t id, std::string label) : id_(id), label_(std::move(label)) {}
    std::uint8_t id() const { return id_; }
    const std::string& label() const { return label_; }

private:
    std::uint8_t id_ = 0;
    std::string label_ = "unknown";
};

// What follows the transitions of its node.
class ManagedEntityInterface {
public:
    virtual ~ManagedEntityInterface() = default;
    virtual void on_activate() = 0;
    virtual void on_deactivate() = 0;
};

// Publishes only while its node is active.
template <class Message, class Allocator = std::allocator<void>>
class LifecyclePublisher : public rclcpp::Publisher<Message, Allocator>, public ManagedEntityInterface {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(LifecyclePublisher)
    using rclcpp::Publisher<Message, Allocator>::Publisher;
    void publish(std::unique_ptr<Message> message) override { publish(*message); }
    void publish(const Message& message) override {
        if (activated_) rclcpp::Publisher<Message, Allocator>::publish(message);
    }
    void on_activate() override { activated_ = true; }
    void on_deactivate() override { activated_ = false; }
    bool is_activated() const { return activated_; }

private:
    bool activated_ = false;
};

namespace node_interfaces {

class LifecycleNodeInterface {
public:
    using Callbacks = lifecycle_msgs::msg::Transition;
    enum class CallbackReturn : std::uint8_t {
        SUCCESS = Callbacks::TRANSITION_CALLBACK_SUCCESS,
        FAILURE = Callbacks::TRANSITION_CALLBACK_FAILURE,
        ERROR = Callbacks::TRANSITION_CALLBACK_ERROR
    };
    virtual ~LifecycleNodeInterface() = default;
    virtual CallbackReturn on_configure(const State&) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_cleanup(const State&) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_shutdown(const State&) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_activate(const State&) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_deactivate(const State&) { return CallbackReturn::SUCCESS; }
    virtual CallbackReturn on_error(const State&) { return CallbackReturn::FAILURE; }
};

}  // namespace node_interfaces

class LifecycleNode : public rclcpp::node_interfaces::NodeMembers,
                      public node_interfaces::LifecycleNodeInterface,
                      public std::enable_shared_from_this<LifecycleNode> {
    using Ids = lifecycle_msgs::msg::State;

public:
    RCLCPP_SMART_PTR_DEFINITIONS(LifecycleNode)
    explicit LifecycleNode(const std::string& name, const rclcpp::NodeOptions& options = rclcpp::NodeOptions(),
                           bool served = true)
        : LifecycleNode(name, "", options, served) {}
    LifecycleNode(const std::string& name, const std::string& ns,
                  const rclcpp::NodeOptions& options = rclcpp::NodeOptions(), bool served = true)
        : NodeMembers(name, ns, options) {
        if (served) serve();
    }

    template <class Message, class Allocator = std::allocator<void>>
    std::shared_ptr<LifecyclePublisher<Message, Allocator>> create_publisher(
        const std::string& topic, const rclcpp::QoS& qos,
        const rclcpp::PublisherOptions& options = rclcpp::PublisherOptions()) {
        auto const made = NodeMembers::create_publisher<Message, Allocator, LifecyclePublisher<Message, Allocator>>(topic, qos, options);
        add_managed_entity(made);
        return made;
    }
    void add_managed_entity(std::weak_ptr<ManagedEntityInterface> entity) { managed_.push_back(std::move(entity)); }

    const State& get_current_state() const { return state_; }
    std::vector<State> get_available_states() const {
        std::vector<State> all;
        for (std::uint8_t const id : {0, 1, 2, 3, 4, 10, 11, 12, 13, 14, 15}) all.push_back(named(id));
        return all;
    }
    const State& configure() { return trigger("configure"); }
    const State& cleanup() { return trigger("cleanup"); }
    const State& activate() { return trigger("activate"); }
    const State& deactivate() { return trigger("deactivate"); }
    const State& shutdown() { return trigger("shutdown"); }
    const State& trigger_transition(std::uint8_t id) {
        for (const auto& one : transitions())
            if (one.id == id && one.from == state_.id()) change(one);
        return state_;
    }
    bool register_on_configure(std::function<CallbackReturn(const State&)> call) { return own_["configure"] = call, true; }
    bool register_on_cleanup(std::function<CallbackReturn(const State&)> call) { return own_["cleanup"] = call, true; }
    bool register_on_shutdown(std::function<CallbackReturn(const State&)> call) { return own_["shutdown"] = call, true; }
    bool register_on_activate(std::function<CallbackReturn(const State&)> call) { return own_["activate"] = call, true; }
    bool register_on_deactivate(std::function<CallbackReturn(const State&)> call) { return own_["deactivate"] = call, true; }
    bool register_on_error(std::function<CallbackReturn(const State&)> call) { return own_["error"] = call, true; }

    // By default the entities of the node follow.
    CallbackReturn on_activate(const State&) override {
        each([](ManagedEntityInterface& one) { one.on_activate(); });
        return CallbackReturn::SUCCESS;
    }
    CallbackReturn on_deactivate(const State&) override {
        each([](ManagedEntityInterface& one) { one.on_deactivate(); });
        return CallbackReturn::SUCCESS;
    }

private:
    struct Change {
        std::uint8_t id;
        const char* label;
        std::uint8_t from, through, to, otherwise;
    };
    static const std::vector<Change>& transitions() {
        static const std::vector<Change> all = {
            {1, "configure", Ids::PRIMARY_STATE_UNCONFIGURED, Ids::TRANSITION_STATE_CONFIGURING, 2, 1},
            {2, "cleanup", Ids::PRIMARY_STATE_INACTIVE, Ids::TRANSITION_STATE_CLEANINGUP, 1, 2},
            {3, "activate", Ids::PRIMARY_STATE_INACTIVE, Ids::TRANSITION_STATE_ACTIVATING, 3, 2},
            {4, "deactivate", Ids::PRIMARY_STATE_ACTIVE, Ids::TRANSITION_STATE_DEACTIVATING, 2, 3},
            {5, "shutdown", Ids::PRIMARY_STATE_UNCONFIGURED, Ids::TRANSITION_STATE_SHUTTINGDOWN, 4, 4},
            {6, "shutdown", Ids::PRIMARY_STATE_INACTIVE, Ids::TRANSITION_STATE_SHUTTINGDOWN, 4, 4},
            {7, "shutdown", Ids::PRIMARY_STATE_ACTIVE, Ids::TRANSITION_STATE_SHUTTINGDOWN, 4, 4},
        };
        return all;
    }
    static State named(std::uint8_t id) {
        static const std::map<std::uint8_t, const char*> labels = {
            {0, "unknown"}, {1, "unconfigured"}, {2, "inactive"}, {3, "active"}, {4, "finalized"},
            {10, "configuring"}, {11, "cleaningup"}, {12, "shuttingdown"}, {13, "activating"},
            {14, "deactivating"}, {15, "errorprocessing"}};
        return State(id, labels.at(id));
    }
    template <class Call>
    void each(Call call) const {
        for (const auto& one : managed_)
            if (auto const entity = one.lock()) call(*entity);
    }
    const State& trigger(const std::string& label) {
        for (const auto& one : transitions())
            if (label == one.label && one.from == state_.id()) {
                change(one);
                return state_;
            }
        RCLCPP_ERROR(get_logger(), "no transition %s from the state %s", label.c_str(), state_.label().c_str());
        return state_;
    }
    CallbackReturn call(const std::string& label, const State& before) {
        try {
            auto const own = own_.find(label);
            if (own != own_.end()) return own->second(before);
            if (label == "configure") return on_configure(before);
            if (label == "cleanup") return on_cleanup(before);
            if (label == "activate") return on_activate(before);
            if (label == "deactivate") return on_deactivate(before);
            if (label == "shutdown") return on_shutdown(before);
            return on_error(before);
        } catch (const std::exception& error) {
            RCLCPP_ERROR(get_logger(), "Caught exception in callback for transition %s: %s", label.c_str(), error.what());
            return CallbackReturn::ERROR;
        }
    }
    // Run the callback of a transition and enter the state that its outcome leads to.
    CallbackReturn change(const Change& by) {
        auto const before = state_;
        enter(by.id, by.label, named(by.through));
        auto const outcome = call(by.label, before);
        if (outcome == CallbackReturn::ERROR) {
            enter(0, "transition_error", named(Ids::TRANSITION_STATE_ERRORPROCESSING));
            bool const recovered = call("error", before) == CallbackReturn::SUCCESS;
            enter(0, "transition_end", named(recovered ? Ids::PRIMARY_STATE_UNCONFIGURED : Ids::PRIMARY_STATE_FINALIZED));
        } else {
            bool const done = outcome == CallbackReturn::SUCCESS;
            enter(0, done ? "transition_success" : "transition_failure", named(done ? by.to : by.otherwise));
        }
        return outcome;
    }
    void enter(std::uint8_t id, const std::string& label, const State& state) {
        if (events_) {
            lifecycle_msgs::msg::TransitionEvent event;
            event.timestamp = static_cast<std::uint64_t>(now().nanoseconds());
            event.transition.set__id(id).set__label(label);
            event.start_state.set__id(state_.id()).set__label(state_.label());
            event.goal_state.set__id(state.id()).set__label(state.label());
            events_->publish(event);
        }
        state_ = state;
    }
    template <class Type, class Fill>
    void offer(const std::string& name, Fill fill) {
        services_.push_back(create_service<Type>(
            name, [fill](std::shared_ptr<typename Type::Request> request, std::shared_ptr<typename Type::Response> response) {
                fill(*request, *response);
            }));
    }
    void serve() {
        using namespace lifecycle_msgs::srv;
        events_ = NodeMembers::create_publisher<lifecycle_msgs::msg::TransitionEvent>("~/transition_event", 10);
        offer<ChangeState>("~/change_state", [this](const auto& request, auto& response) {
            for (const auto& one : transitions()) {
                const auto& wanted = request.transition;
                if (one.from != state_.id() || (wanted.label.empty() ? one.id != wanted.id : one.label != wanted.label)) continue;
                response.success = change(one) == CallbackReturn::SUCCESS;
                return;
            }
        });
        offer<GetState>("~/get_state", [this](const auto&, auto& response) {
            response.current_state.set__id(state_.id()).set__label(state_.label());
        });
        offer<GetAvailableStates>("~/get_available_states", [this](const auto&, auto& response) {
            for (const auto& one : get_available_states()) {
                lifecycle_msgs::msg::State state;
                response.available_states.push_back(state.set__id(one.id()).set__label(one.label()));
            }
        });
        auto describe = [this](bool all) {
            return [this, all](const auto&, auto& response) {
                for (const auto& one : transitions()) {
                    if (!all && one.from != state_.id()) continue;
                    auto& made = response.available_transitions.emplace_back();
                    made.transition.set__id(one.id).set__label(one.label);
                    made.start_state.set__id(one.from).set__label(named(one.from).label());
                    made.goal_state.set__id(one.through).set__label(named(one.through).label());
                }
            };
        };
        offer<GetAvailableTransitions>("~/get_available_transitions", describe(false));
        offer<GetAvailableTransitions>("~/get_transition_graph", describe(true));
    }

    State state_{1, "unconfigured"};
    std::vector<std::weak_ptr<ManagedEntityInterface>> managed_;
    std::map<std::string, std::function<CallbackReturn(const State&)>> own_;
    std::vector<std::shared_ptr<rclcpp::ServiceBase>> services_;
    std::shared_ptr<rclcpp::Publisher<lifecycle_msgs::msg::TransitionEvent>> events_;
};

}  // namespace rclcpp_lifecycle
