// Each form of rclcpp's callbacks, parameters, log lines and executors, in one program.
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <rclcpp/rclcpp.hpp>
#include <geometry_msgs/msg/pose_stamped.hpp>
#include <sensor_msgs/msg/battery_state.hpp>
#include <std_msgs/msg/int32.hpp>
#include <std_srvs/srv/set_bool.hpp>

using namespace std::chrono_literals;
using std::placeholders::_1;
using std::placeholders::_2;
using std_msgs::msg::Int32;
using SetBool = std_srvs::srv::SetBool;

class Forms : public rclcpp::Node {
public:
    explicit Forms(const rclcpp::NodeOptions& options) : Node("forms", options) {
        listen([this](Int32::SharedPtr message) { say("shared", message->data); });
        listen([this](Int32::ConstSharedPtr message) { say("constant", message->data); });
        listen([this](Int32::UniquePtr message) { say("unique", message->data); });
        listen([this](const Int32& message) { say("reference", message.data); });
        listen([this](Int32::SharedPtr message, const rclcpp::MessageInfo& info) {
            say(info.get_rmw_message_info().source_timestamp > 0 ? "stamped" : "no stamp", message->data);
        });
        listen(std::bind(&Forms::on_member, this, _1));
        listen([this](std::shared_ptr<rclcpp::SerializedMessage> bytes) {
            Int32 message;
            rclcpp::Serialization<Int32>().deserialize_message(bytes.get(), &message);
            say("bytes", message.data);
        });
        publisher_ = create_publisher<Int32>("~/numbers", rclcpp::QoS(1).transient_local());
        Int32 message;
        message.set__data(7);
        publisher_->publish(message);
        timer_ = create_wall_timer(100ms, [this] {
            RCLCPP_INFO_SKIPFIRST_THROTTLE(get_logger(), *get_clock(), 250, "tick at %.1f", now().seconds());
            if (++ticks_ == 8) timer_->cancel();
        });
        once_ = create_wall_timer(150ms, [this](rclcpp::TimerBase& timer) {
            timer.cancel();
            say("cancelled", timer.is_canceled());
        });
        service_ = create_service<SetBool>("~/set", std::bind(&Forms::on_set, this, _1, _2));
    }
    void say(const std::string& what, int number) { RCLCPP_INFO_STREAM(get_logger(), what << ' ' << number); }

private:
    template <class Callback>
    void listen(Callback callback) {
        all_.push_back(create_subscription<Int32>("~/numbers", rclcpp::QoS(1).transient_local(), callback));
    }
    void on_member(const Int32::ConstSharedPtr& message) const { RCLCPP_INFO(get_logger(), "member %d", message->data); }
    void on_set(SetBool::Request::SharedPtr request, SetBool::Response::SharedPtr response) {
        response->success = request->data;
        response->message = "set";
    }

    std::vector<rclcpp::SubscriptionBase::SharedPtr> all_;
    rclcpp::Publisher<Int32>::SharedPtr publisher_;
    rclcpp::TimerBase::SharedPtr timer_, once_;
    rclcpp::Service<SetBool>::SharedPtr service_;
    int ticks_ = 0;
};

void use_parameters(Forms& node) {
    auto const speed = node.declare_parameter("speed", 1.0);
    auto const label = node.declare_parameter("label", "none");
    auto const gains = node.declare_parameter("gains", std::vector<double>{0.5});
    rcl_interfaces::msg::ParameterDescriptor range;
    range.integer_range.resize(1);
    range.integer_range[0].set__from_value(0).set__to_value(9);
    node.declare_parameter<int>("level", 3, range);
    auto const names = node.declare_parameter("names", std::vector<std::string>{});
    node.set_parameter(rclcpp::Parameter("names", std::vector<std::string>{"a", "b"}));
    RCLCPP_INFO(node.get_logger(), "names %zu %zu", names.size(), node.get_parameter("names").as_string_array().size());
    rclcpp::Parameter const flags("flags", std::vector<bool>{true, false}), bytes("bytes", std::vector<std::uint8_t>{0, 255});
    RCLCPP_INFO(node.get_logger(), "%s %s", flags.value_to_string().c_str(), bytes.value_to_string().c_str());
    RCLCPP_INFO(node.get_logger(), "speed %g label %s gains %zu", speed, label.c_str(), gains.size());
    try {
        node.declare_parameter("count", 1);
    } catch (const rclcpp::exceptions::InvalidParameterTypeException& error) {
        RCLCPP_WARN(node.get_logger(), "wrong type");
    }
    try {
        node.get_parameter("absent");
    } catch (const rclcpp::exceptions::ParameterNotDeclaredException& error) {
        RCLCPP_WARN(node.get_logger(), "not declared");
    }
    auto const handle = node.add_on_set_parameters_callback([](const std::vector<rclcpp::Parameter>& all) {
        rcl_interfaces::msg::SetParametersResult result;
        result.successful = all[0].as_int() != 5;
        if (!result.successful) result.reason = "no five";
        return result;
    });
    for (int const level : {4, 5, 10}) {
        auto const result = node.set_parameter(rclcpp::Parameter("level", level));
        RCLCPP_INFO(node.get_logger(), "level %d %d %s", level, result.successful, result.reason.c_str());
    }
    std::int64_t level = 0;
    bool const there = node.get_parameter("level", level);
    RCLCPP_INFO(node.get_logger(), "%d %d", there, static_cast<int>(level));
}

int main(int argc, char** argv) {
    rclcpp::init(argc, argv);
    auto const left = rclcpp::remove_ros_arguments(argc, argv);
    rclcpp::NodeOptions options;
    options.append_parameter_override("label", "own");
    auto const node = std::make_shared<Forms>(options);
    RCLCPP_INFO(node->get_logger(), "%s with %s", node->get_fully_qualified_name(), left.at(1).c_str());
    RCLCPP_DEBUG(node->get_logger(), "not shown");
    use_parameters(*node);

    sensor_msgs::msg::BatteryState battery;
    geometry_msgs::msg::PoseStamped pose;
    pose.header.stamp = rclcpp::Time(3, 500000000);
    auto const later = rclcpp::Time(pose.header.stamp) + rclcpp::Duration::from_seconds(1.5);
    RCLCPP_INFO(node->get_logger(), "w %g at %.1f", pose.pose.orientation.w, later.seconds());
    try {
        if (later < rclcpp::Time(1)) return 1;
    } catch (const std::runtime_error& error) {
        RCLCPP_INFO(node->get_logger(), "%s", error.what());
    }

    auto const other = rclcpp::Node::make_shared("other", "deep");
    auto const client = other->create_client<SetBool>("/robot/forms/set");
    rclcpp::executors::MultiThreadedExecutor executor;
    executor.add_node(node);
    executor.add_node(other);
    auto const request = std::make_shared<SetBool::Request>();
    request->data = true;
    client->wait_for_service(1s);
    auto future = client->async_send_request(request);
    auto const code = executor.spin_until_future_complete(future, 2s);
    RCLCPP_INFO(other->get_logger(), "%s %s", rclcpp::to_string(code).c_str(), future.get()->message.c_str());
    std::promise<void> never;
    auto const late = executor.spin_until_future_complete(never.get_future().share(), 50ms);
    RCLCPP_INFO(other->get_logger(), "%s", rclcpp::to_string(late).c_str());
    try {
        rclcpp::spin_some(node);
    } catch (const std::runtime_error& error) {
        RCLCPP_INFO(other->get_logger(), "%s", error.what());
    }
    auto const end = other->create_wall_timer(900ms, [] { rclcpp::shutdown(); });
    client->async_send_request(request, [&](rclcpp::Client<SetBool>::SharedFuture answer) {
        RCLCPP_INFO(other->get_logger(), "called back %d", answer.get()->success);
    });
    executor.spin();
    RCLCPP_INFO(other->get_logger(), "ok %d", rclcpp::ok());
    return 0;
}
