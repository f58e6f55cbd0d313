// actionlib in roscpp: a node that counts, and orders itself to count.
#include <actionlib/client/simple_action_client.h>
#include <actionlib/server/simple_action_server.h>
#include <robot_msgs/CountAction.h>
#include <ros/ros.h>

using Client = actionlib::SimpleActionClient<robot_msgs::CountAction>;

class Counter {
public:
    Counter() : server_(node_, "count", boost::bind(&Counter::execute, this, _1), false) { server_.start(); }

private:
    void execute(const robot_msgs::CountGoalConstPtr& goal) {
        ros::Rate rate(10);
        robot_msgs::CountResult result;
        while (result.reached < goal->until) {
            if (server_.isPreemptRequested()) {
                server_.setPreempted(result, "as you wish");
                return;
            }
            ++result.reached;
            robot_msgs::CountFeedback feedback;
            feedback.at = result.reached;
            server_.publishFeedback(feedback);
            rate.sleep();
        }
        if (goal->until > 0) server_.setSucceeded(result);
    }

    ros::NodeHandle node_;
    actionlib::SimpleActionServer<robot_msgs::CountAction> server_;
};

int main(int argc, char** argv) {
    ros::init(argc, argv, "actions");
    Counter counter;
    ros::AsyncSpinner spinner(1);
    spinner.start();
    Client client("count", true);
    ROS_INFO("server %d", client.waitForServer(ros::Duration(5.0)));

    robot_msgs::CountGoal goal;
    goal.until = 3;
    client.sendGoal(
        goal,
        [](const actionlib::SimpleClientGoalState& state, const robot_msgs::CountResultConstPtr& result) {
            ROS_INFO("done %s %d", state.toString().c_str(), result->reached);
        },
        [] { ROS_INFO("active"); },
        [](const robot_msgs::CountFeedbackConstPtr& feedback) { ROS_INFO("at %d", feedback->at); });
    ROS_INFO("in time %d", client.waitForResult(ros::Duration(5.0)));

    goal.until = 1000;
    client.sendGoal(goal);
    ROS_INFO("in time %d", client.waitForResult(ros::Duration(0.55)));
    client.cancelGoal();
    client.waitForResult();
    ROS_INFO("%s %d %s", client.getState().toString().c_str(), client.getResult()->reached,
             client.getState().getText().c_str());

    client.sendGoal(goal);
    ros::Duration(0.25).sleep();
    goal.until = 1;
    ROS_INFO("next %s", client.sendGoalAndWait(goal).toString().c_str());
    goal.until = 0;
    ROS_INFO("without an end %s", client.sendGoalAndWait(goal).toString().c_str());
    return 0;
}
