// What both sides of an action use: its types, and ids of goals.
#pragma once
#include <string>

#include "actionlib_msgs/GoalID.h"
#include "actionlib_msgs/GoalStatusArray.h"
#include "ros/event.h"
#include "ros/ros.h"

namespace actionlib {

using ros::detail::Event;

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
