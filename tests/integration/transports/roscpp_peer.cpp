// A node of roscpp to test against: it says what it hears, with its own mark, and serves and calls a service.
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <std_srvs/SetBool.h>

static ros::Publisher echo;

static void hear(const std_msgs::String& message) {
    std_msgs::String answer;
    answer.data = "roscpp heard " + message.data;
    echo.publish(answer);
}

static bool set(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
    response.success = request.data;
    response.message = "roscpp";
    return true;
}

static void call(const std_msgs::String& message) {
    std_srvs::SetBool exchange;
    exchange.request.data = true;
    std_msgs::String answer;
    if (ros::service::call(message.data, exchange)) {
        answer.data = "roscpp was told " + exchange.response.message;
    } else {
        answer.data = "roscpp was refused";
    }
    echo.publish(answer);
}

int main(int argc, char** argv) {
    ros::init(argc, argv, "roscpp_peer");
    ros::NodeHandle node;
    echo = node.advertise<std_msgs::String>("from_roscpp", 10, true);
    const ros::Subscriber heard = node.subscribe("to_roscpp", 10, hear);
    const ros::Subscriber asked = node.subscribe("let_roscpp_call", 10, call);
    const ros::ServiceServer served = node.advertiseService("roscpp_set", set);
    ros::spin();
    return 0;
}
