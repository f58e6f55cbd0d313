// actionlib::SimpleActionServer, on the topics of the protocol of actions.
#pragma once
#include <boost/function.hpp>
#include <list>
#include <memory>
#include <string>

#include "actionlib/action_types.h"

namespace actionlib {

// Executes one goal at a time; a new goal preempts the one before.
template <class Action>
class SimpleActionServer {
public:
    using Goal = typename Types<Action>::Goal;
    using Result = typename Types<Action>::Result;
    using Feedback = typename Types<Action>::Feedback;
    using GoalConstPtr = boost::shared_ptr<Goal const>;
    using ExecuteCallback = boost::function<void(const GoalConstPtr&)>;

    SimpleActionServer(const std::string& name, ExecuteCallback execute, bool auto_start = true)
        : SimpleActionServer(ros::NodeHandle(), name, execute, auto_start) {}
    explicit SimpleActionServer(const std::string& name, bool auto_start = true)
        : SimpleActionServer(ros::NodeHandle(), name, ExecuteCallback(), auto_start) {}
    SimpleActionServer(const ros::NodeHandle& node, const std::string& name, bool auto_start = true)
        : SimpleActionServer(node, name, ExecuteCallback(), auto_start) {}
    SimpleActionServer(const ros::NodeHandle& node, const std::string& name, ExecuteCallback execute,
                       bool auto_start = true)
        : node_(node, name), execute_(execute), life_(std::make_shared<Life>()) {
        if (execute_) {
            auto const callable = volery::register_callable([this, life = life_](volery::Reader, volery::Writer&) {
                execute_goals(*life);
            });
            volery::request("ros.spawn", volery::Writer().put(callable).put("goals of " + name));
        }
        if (auto_start) start();
    }
    SimpleActionServer(const SimpleActionServer&) = delete;
    SimpleActionServer& operator=(const SimpleActionServer&) = delete;
    ~SimpleActionServer() { shutdown(); }

    void start() {
        statuses_ = node_.advertise<actionlib_msgs::GoalStatusArray>("status", 50, true);
        results_ = node_.advertise<typename Types<Action>::ActionResult>("result", 50);
        feedback_ = node_.advertise<typename Types<Action>::ActionFeedback>("feedback", 50);
        goals_ = node_.subscribe("goal", 50, &SimpleActionServer::on_goal, this);
        cancels_ = node_.subscribe("cancel", 50, &SimpleActionServer::on_cancel, this);
        timer_ = node_.createTimer(ros::Duration(0.2), &SimpleActionServer::on_timer, this);
        publish_status();
    }
    void shutdown() {
        life_->ended = true;
        goals_.shutdown();
        cancels_.shutdown();
        timer_.stop();
    }

    GoalConstPtr acceptNewGoal() {
        if (!new_goal_ || !next_) {
            ROS_ERROR("acceptNewGoal: there is no new goal");
            return {};
        }
        if (isActive() && current_ != next_) cancel(current_, "a new goal replaces it");
        current_ = next_;
        new_goal_ = false;
        preempt_request_ = new_goal_preempt_request_;
        new_goal_preempt_request_ = false;
        set(current_, current_->status.status == Status::RECALLING ? Status::PREEMPTING : Status::ACTIVE,
            "This goal has been accepted by the simple action server");
        return current_->goal;
    }
    bool isNewGoalAvailable() const { return new_goal_; }
    bool isPreemptRequested() const { return preempt_request_; }
    bool isActive() const { return current_ && begun(current_->status.status); }
    void setSucceeded(const Result& result = Result(), const std::string& text = "") {
        end(current_, Status::SUCCEEDED, result, text);
    }
    void setAborted(const Result& result = Result(), const std::string& text = "") {
        end(current_, Status::ABORTED, result, text);
    }
    void setPreempted(const Result& result = Result(), const std::string& text = "") {
        end(current_, Status::PREEMPTED, result, text);
    }
    void publishFeedback(const Feedback& feedback) {
        if (!current_) return;
        typename Types<Action>::ActionFeedback message;
        message.header.stamp = ros::Time::now();
        message.status = current_->status;
        message.feedback = feedback;
        feedback_.publish(message);
    }
    void publishFeedback(const boost::shared_ptr<Feedback const>& feedback) { publishFeedback(*feedback); }
    void registerGoalCallback(boost::function<void()> callback) {
        if (execute_)
            ROS_WARN("registerGoalCallback: the server has an execute callback, which takes the goals");
        else
            goal_callback_ = callback;
    }
    void registerPreemptCallback(boost::function<void()> callback) { preempt_callback_ = callback; }

private:
    struct Entry {
        Status status;
        GoalConstPtr goal;
        ros::Time ended;
    };
    using EntryPtr = std::shared_ptr<Entry>;
    // Outlives the server, for the task that executes its goals may still wait.
    struct Life {
        Event event;
        bool ended = false;
    };
    static constexpr double KEPT = 5.0;  // seconds for which an ended goal is reported

    static bool begun(int status) { return status == Status::ACTIVE || status == Status::PREEMPTING; }
    static bool waiting(int status) { return status == Status::PENDING || status == Status::RECALLING; }

    void on_timer(const ros::TimerEvent&) { publish_status(); }
    void publish_status() {
        actionlib_msgs::GoalStatusArray message;
        auto const now = message.header.stamp = ros::Time::now();
        entries_.remove_if([&](const EntryPtr& one) {
            return !one->ended.isZero() && now - one->ended > ros::Duration(KEPT);
        });
        for (const auto& one : entries_) message.status_list.push_back(one->status);
        statuses_.publish(message);
    }
    void set(const EntryPtr& entry, int status, const std::string& text) {
        entry->status.status = static_cast<std::uint8_t>(status);
        entry->status.text = text;
        publish_status();
    }
    void end(const EntryPtr& entry, int status, const Result& result, const std::string& text) {
        if (!entry || !entry->ended.isZero()) {
            ROS_ERROR("a goal can only end while it is active");
            return;
        }
        entry->ended = ros::Time::now();
        entry->status.status = static_cast<std::uint8_t>(status);
        entry->status.text = text;
        typename Types<Action>::ActionResult message;
        message.header.stamp = entry->ended;
        message.status = entry->status;
        message.result = result;
        results_.publish(message);
        publish_status();
    }
    void cancel(const EntryPtr& entry, const std::string& text) {
        end(entry, waiting(entry->status.status) ? Status::RECALLED : Status::PREEMPTED, Result(), text);
    }

    void on_goal(const boost::shared_ptr<typename Types<Action>::ActionGoal const>& message) {
        for (const auto& one : entries_)
            if (one->status.goal_id.id == message->goal_id.id) return;
        auto const entry = std::make_shared<Entry>();
        entry->status.goal_id = message->goal_id;
        if (entry->status.goal_id.id.empty()) entry->status.goal_id.id = new_id();
        if (entry->status.goal_id.stamp.isZero()) entry->status.goal_id.stamp = ros::Time::now();
        entry->goal = boost::make_shared<Goal>(message->goal);
        entries_.push_back(entry);
        auto const stamp = entry->status.goal_id.stamp;
        bool const canceled = !message->goal_id.stamp.isZero() && stamp <= last_cancel_;
        bool const older = (current_ && stamp < current_->status.goal_id.stamp) ||
                           (next_ && stamp < next_->status.goal_id.stamp);
        if (canceled || older) {
            cancel(entry, canceled ? "it was canceled before it came" : "a newer goal is there");
            return;
        }
        if (next_ && next_ != current_ && next_->ended.isZero()) cancel(next_, "a new goal replaces it");
        next_ = entry;
        new_goal_ = true;
        new_goal_preempt_request_ = false;
        if (isActive()) preempt();
        if (goal_callback_) goal_callback_();
        life_->event.notify();
    }
    void on_cancel(const actionlib_msgs::GoalIDConstPtr& message) {
        bool const all = message->id.empty() && message->stamp.isZero();
        auto const entries = entries_;
        for (const auto& one : entries) {
            const auto& own = one->status.goal_id;
            bool const before = !message->stamp.isZero() && own.stamp <= message->stamp;
            if (!(all || own.id == message->id || before) || !one->ended.isZero()) continue;
            bool const pending = one->status.status == Status::PENDING;
            if (!pending && one->status.status != Status::ACTIVE) continue;
            set(one, pending ? Status::RECALLING : Status::PREEMPTING, one->status.text);
            if (one == current_)
                preempt();
            else if (one == next_)
                new_goal_preempt_request_ = true;
        }
        if (message->stamp > last_cancel_) last_cancel_ = message->stamp;
    }
    void preempt() {
        preempt_request_ = true;
        if (preempt_callback_) preempt_callback_();
    }
    void execute_goals(Life& life) {
        while (ros::ok() && !life.ended) {
            life.event.wait([&] { return life.ended || new_goal_; }, ros::Duration(0.0));
            if (life.ended || !new_goal_) continue;
            auto const goal = acceptNewGoal();
            if (!goal) continue;
            execute_(goal);
            if (!life.ended && ros::ok() && isActive()) {
                ROS_WARN("the execute callback has returned without an end of its goal, which is aborted");
                setAborted(Result(), "This goal was aborted by the simple action server. The user should have set a "
                                     "terminal status on this goal and did not");
            }
        }
    }

    ros::NodeHandle node_;
    ExecuteCallback execute_;
    std::shared_ptr<Life> life_;
    boost::function<void()> goal_callback_, preempt_callback_;
    std::list<EntryPtr> entries_;
    EntryPtr current_, next_;
    bool new_goal_ = false, preempt_request_ = false, new_goal_preempt_request_ = false;
    ros::Time last_cancel_;
    ros::Publisher statuses_, results_, feedback_;
    ros::Subscriber goals_, cancels_;
    ros::Timer timer_;
};

}  // namespace actionlib
