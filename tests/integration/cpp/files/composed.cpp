// Two nodes of a composition, without a main(): one asks, the other one answers later.
#include <deque>

#include <rclcpp/rclcpp.hpp>
#include <rclcpp_components/register_node_macro.hpp>
#include <std_srvs/srv/trigger.hpp>

using namespace std::chrono_literals;
using Trigger = std_srvs::srv::Trigger;

namespace composed {

class Answering : public rclcpp::Node {
public:
    explicit Answering(const rclcpp::NodeOptions& options) : Node("answering", options) {
        service_ = create_service<Trigger>(
            "ask", [this](std::shared_ptr<rmw_request_id_t> id, std::shared_ptr<Trigger::Request>) { ids_.push_back(id); });
        timer_ = create_timer(1s, [this] {
            for (const auto& id : ids_) {
                Trigger::Response response;
                response.message = "at last";
                service_->send_response(*id, response);
            }
            ids_.clear();
        });
    }

private:
    std::deque<std::shared_ptr<rmw_request_id_t>> ids_;
    rclcpp::Service<Trigger>::SharedPtr service_;
    rclcpp::TimerBase::SharedPtr timer_;
};

class Asking : public rclcpp::Node {
public:
    explicit Asking(const rclcpp::NodeOptions& options) : Node("asking", options) {
        client_ = create_client<Trigger>("ask");
        timer_ = create_wall_timer(300ms, [this] {
            timer_->cancel();
            client_->async_send_request(std::make_shared<Trigger::Request>(), [this](rclcpp::Client<Trigger>::SharedFuture answer) {
                RCLCPP_INFO(get_logger(), "%s: %s", get_name(), answer.get()->message.c_str());
            });
        });
    }

private:
    rclcpp::Client<Trigger>::SharedPtr client_;
    rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace composed

RCLCPP_COMPONENTS_REGISTER_NODE(composed::Answering)
RCLCPP_COMPONENTS_REGISTER_NODE(composed::Asking)
