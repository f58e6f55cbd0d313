// An action server whose goals are executed by threads, and a client that waits, listens and cancels.
#include <chrono>
#include <functional>
#include <memory>
#include <thread>

#include <rclcpp/rclcpp.hpp>
#include <rclcpp_action/rclcpp_action.hpp>
#include <robot_msgs/action/count.hpp>

using namespace std::chrono_literals;
using Count = robot_msgs::action::Count;
using Serving = rclcpp_action::ServerGoalHandle<Count>;
using Sent = rclcpp_action::ClientGoalHandle<Count>;

class Server : public rclcpp::Node {
public:
    Server() : Node("server") {
        using std::placeholders::_1;
        server_ = rclcpp_action::create_server<Count>(
            this, "count",
            [](const rclcpp_action::GoalUUID&, std::shared_ptr<const Count::Goal> goal) {
                return goal->until > 0 ? rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE : rclcpp_action::GoalResponse::REJECT;
            },
            [](std::shared_ptr<Serving>) { return rclcpp_action::CancelResponse::ACCEPT; },
            [this](std::shared_ptr<Serving> handle) { std::thread{std::bind(&Server::execute, this, _1), handle}.detach(); });
    }

private:
    void execute(const std::shared_ptr<Serving> handle) {
        rclcpp::Rate rate(10);
        auto const result = std::make_shared<Count::Result>();
        auto const feedback = std::make_shared<Count::Feedback>();
        for (int at = 1; at <= handle->get_goal()->until; ++at) {
            result->reached = feedback->at = at;
            if (handle->is_canceling()) {
                handle->canceled(result);
                return;
            }
            handle->publish_feedback(feedback);
            rate.sleep();
        }
        handle->succeed(result);
    }
    rclcpp_action::Server<Count>::SharedPtr server_;
};

int main(int argc, char** argv) {
    rclcpp::init(argc, argv);
    auto const server = std::make_shared<Server>();
    auto const node = rclcpp::Node::make_shared("client");
    auto const log = node->get_logger();
    rclcpp::executors::SingleThreadedExecutor serving;
    serving.add_node(server);
    std::thread beside([&] { serving.spin(); });

    auto const client = rclcpp_action::create_client<Count>(node, "count");
    RCLCPP_INFO(log, "there %d", client->wait_for_action_server(2s));
    Count::Goal goal;
    auto send = [&](int until, const rclcpp_action::Client<Count>::SendGoalOptions& options = {}) {
        goal.until = until;
        auto future = client->async_send_goal(goal, options);
        rclcpp::spin_until_future_complete(node, future);
        return future.get();
    };
    auto wait = [&](const Sent::SharedPtr& handle) {
        auto future = client->async_get_result(handle);
        rclcpp::spin_until_future_complete(node, future);
        return future.get();
    };
    RCLCPP_INFO(log, "rejected %d", send(0) == nullptr);

    rclcpp_action::Client<Count>::SendGoalOptions options;
    options.goal_response_callback = [&](Sent::SharedPtr handle) { RCLCPP_INFO(log, "accepted %d", handle != nullptr); };
    options.feedback_callback = [&](Sent::SharedPtr, const std::shared_ptr<const Count::Feedback> feedback) {
        RCLCPP_INFO(log, "at %d", feedback->at);
    };
    options.result_callback = [&](const Sent::WrappedResult& result) { RCLCPP_INFO(log, "called back %d", result.result->reached); };
    auto const done = wait(send(3, options));
    RCLCPP_INFO(log, "succeeded %d with %d", done.code == rclcpp_action::ResultCode::SUCCEEDED, done.result->reached);

    auto const long_one = send(100);
    rclcpp::sleep_for(250ms);
    auto answer = client->async_cancel_goal(long_one);
    rclcpp::spin_until_future_complete(node, answer);
    RCLCPP_INFO(log, "cancelling %zu", answer.get()->goals_canceling.size());
    auto const ended = wait(long_one);
    RCLCPP_INFO(log, "cancelled %d with %d", ended.code == rclcpp_action::ResultCode::CANCELED, ended.result->reached);
    try {
        client->async_get_result(nullptr);
    } catch (const rclcpp_action::exceptions::UnknownGoalHandleError& error) {
        RCLCPP_INFO(log, "%s", error.what());
    }
    serving.cancel();
    beside.join();
    rclcpp::shutdown();
    return 0;
}
