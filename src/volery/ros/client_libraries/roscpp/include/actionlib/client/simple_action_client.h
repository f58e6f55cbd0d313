// actionlib::SimpleActionClient, on the topics of the protocol of actions.
#pragma once
#include <boost/function.hpp>
#include <memory>
#include <string>

#include "actionlib/action_types.h"

namespace actionlib {

class SimpleClientGoalState {
public:
    enum StateEnum { PENDING, ACTIVE, RECALLED, REJECTED, PREEMPTED, ABORTED, SUCCEEDED, LOST };

    SimpleClientGoalState(StateEnum state, const std::string& text = "") : state_(state), text_(text) {}
    bool operator==(const SimpleClientGoalState& other) const { return state_ == other.state_; }
    bool operator==(StateEnum state) const { return state_ == state; }
    bool operator!=(const SimpleClientGoalState& other) const { return state_ != other.state_; }
    bool operator!=(StateEnum state) const { return state_ != state; }
    bool isDone() const { return state_ != PENDING && state_ != ACTIVE; }
    std::string getText() const { return text_; }
    std::string toString() const {
        static const char* const NAMES[] = {"PENDING",   "ACTIVE",  "RECALLED",  "REJECTED",
                                            "PREEMPTED", "ABORTED", "SUCCEEDED", "LOST"};
        return NAMES[state_];
    }

    StateEnum state_;
    std::string text_;
};

template <class Action>
class SimpleActionClient {
public:
    using Goal = typename Types<Action>::Goal;
    using Result = typename Types<Action>::Result;
    using Feedback = typename Types<Action>::Feedback;
    using GoalConstPtr = boost::shared_ptr<Goal const>;
    using ResultConstPtr = boost::shared_ptr<Result const>;
    using FeedbackConstPtr = boost::shared_ptr<Feedback const>;
    using SimpleDoneCallback = boost::function<void(const SimpleClientGoalState&, const ResultConstPtr&)>;
    using SimpleActiveCallback = boost::function<void()>;
    using SimpleFeedbackCallback = boost::function<void(const FeedbackConstPtr&)>;

    explicit SimpleActionClient(const std::string& name, bool spin_thread = true)
        : SimpleActionClient(ros::NodeHandle(), name, spin_thread) {}
    SimpleActionClient(const ros::NodeHandle& node, const std::string& name, bool spin_thread = true)
        : node_(node, name), state_(std::make_shared<State>()), spinner_(1, &state_->queue) {
        if (spin_thread) node_.setCallbackQueue(&state_->queue);
        goals_ = node_.advertise<typename Types<Action>::ActionGoal>("goal", 10);
        cancels_ = node_.advertise<actionlib_msgs::GoalID>("cancel", 10);
        // The callbacks own the state: a client may be destroyed while one of them runs in the spinner's task.
        auto const state = state_;
        listen<actionlib_msgs::GoalStatusArray>("status", [state](const auto& message) { state->on_status(*message); });
        listen<typename Types<Action>::ActionResult>("result", [state](const auto& message) { state->on_result(message); });
        listen<typename Types<Action>::ActionFeedback>("feedback",
                                                       [state](const auto& message) { state->on_feedback(message); });
        if (spin_thread) spinner_.start();
    }
    SimpleActionClient(const SimpleActionClient&) = delete;
    SimpleActionClient& operator=(const SimpleActionClient&) = delete;
    ~SimpleActionClient() { spinner_.stop(); }

    bool isServerConnected() const {
        if (goals_.getNumSubscribers() == 0 || cancels_.getNumSubscribers() == 0) return false;
        for (const auto& one : subscriptions_)
            if (one.getNumPublishers() == 0) return false;
        return true;
    }
    bool waitForServer(const ros::Duration& timeout = ros::Duration(0.0)) const {
        auto const end = ros::Time::now() + timeout;
        while (ros::ok()) {
            if (isServerConnected()) return true;
            if (!timeout.isZero() && ros::Time::now() >= end) return false;
            ros::Duration(0.01).sleep();
        }
        return false;
    }
    void sendGoal(const Goal& goal, SimpleDoneCallback done = SimpleDoneCallback(),
                  SimpleActiveCallback active = SimpleActiveCallback(),
                  SimpleFeedbackCallback feedback = SimpleFeedbackCallback()) {
        typename Types<Action>::ActionGoal message;
        message.header.stamp = message.goal_id.stamp = ros::Time::now();
        message.goal_id.id = new_id();
        message.goal = goal;
        state_->begin(message.goal_id.id, done, active, feedback);
        goals_.publish(message);
    }
    SimpleClientGoalState sendGoalAndWait(const Goal& goal, const ros::Duration& execute = ros::Duration(0.0),
                                          const ros::Duration& preempt = ros::Duration(0.0)) {
        sendGoal(goal);
        if (!waitForResult(execute)) {
            cancelGoal();
            waitForResult(preempt);
        }
        return getState();
    }
    // A time-out of 0 means none.
    bool waitForResult(const ros::Duration& timeout = ros::Duration(0.0)) {
        if (state_->id.empty()) {
            ROS_ERROR("waitForResult: there is no goal");
            return false;
        }
        return state_->event.wait([this] { return state_->done; }, timeout);
    }
    ResultConstPtr getResult() const { return state_->result ? state_->result : boost::make_shared<Result>(); }
    SimpleClientGoalState getState() const {
        return state_->id.empty() ? SimpleClientGoalState(SimpleClientGoalState::LOST) : state_->now;
    }
    void cancelGoal() { cancel(state_->id, ros::Time()); }
    void cancelAllGoals() { cancel("", ros::Time()); }
    void cancelGoalsAtAndBeforeTime(const ros::Time& time) { cancel("", time); }
    void stopTrackingGoal() { state_->id.clear(); }

private:
    using Simple = SimpleClientGoalState;

    struct State {
        ros::CallbackQueue queue;
        Event event;
        std::string id;
        Simple now{Simple::LOST};
        bool done = false;
        ResultConstPtr result;
        SimpleDoneCallback on_done;
        SimpleActiveCallback on_active;
        SimpleFeedbackCallback on_progress;

        void begin(const std::string& goal, const SimpleDoneCallback& when_done,
                   const SimpleActiveCallback& when_active, const SimpleFeedbackCallback& progress) {
            id = goal;
            now = Simple(Simple::PENDING);
            done = false;
            result.reset();
            on_done = when_done;
            on_active = when_active;
            on_progress = progress;
        }
        void activate() {
            if (now != Simple::PENDING) return;
            now = Simple(Simple::ACTIVE);
            if (on_active) on_active();
        }
        void on_status(const actionlib_msgs::GoalStatusArray& message) {
            for (const auto& one : message.status_list) {
                bool const begun = one.status == Status::ACTIVE || one.status == Status::PREEMPTING;
                if (one.goal_id.id == id && begun) activate();
            }
        }
        template <class Message>
        void on_result(const Message& message) {
            const auto& status = message->status;
            if (id.empty() || done || status.goal_id.id != id) return;
            Simple ended(Simple::LOST, status.text);
            switch (status.status) {
                case Status::RECALLED: ended.state_ = Simple::RECALLED; break;
                case Status::REJECTED: ended.state_ = Simple::REJECTED; break;
                case Status::PREEMPTED: ended.state_ = Simple::PREEMPTED; break;
                case Status::ABORTED: ended.state_ = Simple::ABORTED; break;
                case Status::SUCCEEDED: ended.state_ = Simple::SUCCEEDED; break;
                default: break;
            }
            if (ended != Simple::RECALLED && ended != Simple::REJECTED) activate();
            now = ended;
            result = boost::make_shared<Result>(message->result);
            auto const goal = id;
            if (on_done) on_done(now, result);
            if (id == goal) done = true;  // the callback may have sent another goal
            event.notify();
        }
        template <class Message>
        void on_feedback(const Message& message) {
            if (message->status.goal_id.id == id && !id.empty() && on_progress)
                on_progress(boost::make_shared<Feedback>(message->feedback));
        }
    };

    template <class Message, class Callback>
    void listen(const std::string& topic, Callback callback) {
        subscriptions_.push_back(node_.subscribe<Message>(
            topic, 10, boost::function<void(const boost::shared_ptr<Message const>&)>(callback)));
    }
    void cancel(const std::string& id, const ros::Time& stamp) {
        actionlib_msgs::GoalID message;
        message.id = id;
        message.stamp = stamp;
        cancels_.publish(message);
    }

    ros::NodeHandle node_;
    std::shared_ptr<State> state_;
    ros::AsyncSpinner spinner_;
    ros::Publisher goals_, cancels_;
    ros::V_Subscriber subscriptions_;
};

}  // namespace actionlib
