// What both sides of an action use: waiting for a condition of another task, and the types of an action.
#pragma once
#include <string>

#include "actionlib_msgs/GoalID.h"
#include "actionlib_msgs/GoalStatusArray.h"
#include "ros/ros.h"

namespace actionlib {

// A task waits until another one says that something has changed.
class Event {
public:
    void notify() {
        ++count_;
        volery::request("ros.event_notify", volery::Writer().put(number()));
    }
    // Wait for a condition; return whether it holds. A time-out of 0 means none.
    template <class Condition>
    bool wait(Condition condition, const ros::Duration& timeout) {
        auto const end = ros::Time::now() + timeout;
        while (true) {
            auto const seen = count_;
            if (condition()) return true;
            auto const left = end - ros::Time::now();
            if (!ros::ok() || (!timeout.isZero() && left <= ros::Duration(0.0))) return false;
            auto const within = timeout.isZero() ? std::int64_t{-1} : left.toNSec();
            volery::request("ros.event_wait", volery::Writer().put(number()).put(seen).put(within));
        }
    }

private:
    std::int64_t number() {
        if (number_ < 0) number_ = volery::request("ros.event").integer();
        return number_;
    }
    std::int64_t number_ = -1, count_ = 0;
};

template <class Action>
struct Types {
    using ActionGoal = decltype(Action::action_goal);
    using ActionResult = decltype(Action::action_result);
    using ActionFeedback = decltype(Action::action_feedback);
    using Goal = decltype(ActionGoal::goal);
    using Result = decltype(ActionResult::result);
    using Feedback = decltype(ActionFeedback::feedback);
};

using Status = actionlib_msgs::GoalStatus;

inline std::string new_id() {
    static int count = 0;
    std::ostringstream text;
    text << ros::this_node::getName() << '-' << ++count << '-' << ros::Time::now();
    return text.str();
}

}  // namespace actionlib
