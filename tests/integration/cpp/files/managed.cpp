// A node with a lifecycle, transforms of tf2, clients of parameters, filters of messages, diagnostics and events.
#include <chrono>
#include <memory>

#include <diagnostic_updater/diagnostic_updater.hpp>
#include <geometry_msgs/msg/point_stamped.hpp>
#include <message_filters/subscriber.h>
#include <message_filters/sync_policies/approximate_time.h>
#include <message_filters/synchronizer.h>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_lifecycle/lifecycle_node.hpp>
#include <sensor_msgs/point_cloud2_iterator.hpp>
#include <std_msgs/msg/int32.hpp>
#include <tf2/LinearMath/Quaternion.h>
#include <tf2/exceptions.h>
#include <tf2_geometry_msgs/tf2_geometry_msgs.hpp>
#include <tf2_ros/buffer.h>
#include <tf2_ros/message_filter.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <tf2_sensor_msgs/tf2_sensor_msgs.hpp>

using namespace std::chrono_literals;
using ChangeState = lifecycle_msgs::srv::ChangeState;
using Transition = lifecycle_msgs::msg::Transition;

class Managed : public rclcpp_lifecycle::LifecycleNode {
public:
    Managed() : LifecycleNode("managed") { declare_parameter("level", 3); }
    CallbackReturn on_configure(const rclcpp_lifecycle::State& before) override {
        publisher_ = create_publisher<std_msgs::msg::Int32>("numbers", 10);
        RCLCPP_INFO(get_logger(), "from %s", before.label().c_str());
        return CallbackReturn::SUCCESS;
    }
    CallbackReturn on_deactivate(const rclcpp_lifecycle::State& before) override {
        LifecycleNode::on_deactivate(before);
        throw std::runtime_error("broken");
    }
    CallbackReturn on_error(const rclcpp_lifecycle::State&) override { return CallbackReturn::SUCCESS; }
    void publish(int number) { publisher_->publish(std_msgs::msg::Int32().set__data(number)); }

private:
    rclcpp_lifecycle::LifecyclePublisher<std_msgs::msg::Int32>::SharedPtr publisher_;
};

using geometry_msgs::msg::PointStamped;
using sensor_msgs::msg::PointCloud2;

// Messages of two topics that belong together, and those of one whose frame is known.
class Filtering : public rclcpp::Node {
public:
    Filtering() : Node("filtering"), buffer_(get_clock()), listener_(buffer_) {
        left_.subscribe(this, "left", rmw_qos_profile_sensor_data);
        right_.subscribe(this, "right");
        pairs_ = std::make_shared<Pairs>(Policy(10), left_, right_);
        pairs_->setMaxIntervalDuration(rclcpp::Duration(50ms));
        pairs_->registerCallback(std::bind(&Filtering::on_pair, this, std::placeholders::_1, std::placeholders::_2));
        placed_ = std::make_shared<tf2_ros::MessageFilter<PointStamped>>(
            left_, buffer_, "world", 5, get_node_logging_interface(), get_node_clock_interface(), 1s);
        placed_->registerCallback(&Filtering::on_placed, this);
    }

private:
    using Policy = message_filters::sync_policies::ApproximateTime<PointStamped, PointStamped>;
    using Pairs = message_filters::Synchronizer<Policy>;
    void on_pair(const PointStamped::ConstSharedPtr& left, const PointStamped::ConstSharedPtr& right) {
        RCLCPP_INFO(get_logger(), "pair %g %g", left->point.x, right->point.x);
    }
    void on_placed(const PointStamped::ConstSharedPtr& point) {
        RCLCPP_INFO(get_logger(), "placed %g at %.1f", point->point.x, buffer_.transform(*point, "world").point.x);
    }
    tf2_ros::Buffer buffer_;
    tf2_ros::TransformListener listener_;
    message_filters::Subscriber<PointStamped> left_, right_;
    std::shared_ptr<Pairs> pairs_;
    std::shared_ptr<tf2_ros::MessageFilter<PointStamped>> placed_;
};

void use_filters(const rclcpp::Node::SharedPtr& node) {
    auto const filtering = std::make_shared<Filtering>();
    auto const left = node->create_publisher<PointStamped>("left", 10), right = node->create_publisher<PointStamped>("right", 10);
    rclcpp::executors::SingleThreadedExecutor executor;
    executor.add_node(filtering);
    auto send = [&](const rclcpp::Publisher<PointStamped>::SharedPtr& to, double x, double later) {
        PointStamped point;
        point.header.frame_id = "eye";
        point.header.stamp = rclcpp::Time(100, 0, RCL_ROS_TIME) + rclcpp::Duration::from_seconds(later);
        point.point.x = x;
        to->publish(point);
        executor.spin_some();
    };
    send(left, 1, 0.0);
    send(right, 10, 0.02);
    send(left, 2, 0.2);
    send(right, 20, 0.3);
    send(left, 3, 0.31);
    send(right, 30, 0.5);
    tf2_ros::StaticTransformBroadcaster fixed(node);
    geometry_msgs::msg::TransformStamped transform;
    transform.header.frame_id = "world";
    transform.child_frame_id = "eye";
    transform.transform.translation.x = 5.0;
    fixed.sendTransform(transform);
    for (int turn = 0; turn < 4; ++turn) executor.spin_once(10ms);

    PointCloud2 cloud;
    cloud.height = cloud.width = 1;
    cloud.header.frame_id = "eye";
    sensor_msgs::PointCloud2Modifier modifier(cloud);
    modifier.setPointCloud2Fields(4, "x", 1, sensor_msgs::msg::PointField::FLOAT32, "y", 1, sensor_msgs::msg::PointField::FLOAT32,
                                  "z", 1, sensor_msgs::msg::PointField::FLOAT32, "rgb", 1, sensor_msgs::msg::PointField::FLOAT32);
    modifier.resize(3);
    sensor_msgs::PointCloud2Iterator<float> x(cloud, "x");
    sensor_msgs::PointCloud2Iterator<std::uint8_t> green(cloud, "g");
    for (float number = 0; x != x.end(); ++x, ++green, ++number) *x = number, *green = 7;
    PointCloud2 moved;
    tf2::doTransform(cloud, moved, transform);
    float sum = 0;
    for (sensor_msgs::PointCloud2ConstIterator<float> each(moved, "x"); each != each.end(); ++each) sum += *each;
    RCLCPP_INFO(node->get_logger(), "cloud of %zu in %s: %g, step %u, byte 13 is %d", modifier.size(), moved.header.frame_id.c_str(),
                sum, cloud.point_step, cloud.data[13]);
}

void use_diagnostics(const rclcpp::Node::SharedPtr& node) {
    auto const heard = node->create_subscription<diagnostic_msgs::msg::DiagnosticArray>(
        "/diagnostics", 10, [&](const diagnostic_msgs::msg::DiagnosticArray& array) {
            for (const auto& one : array.status)
                RCLCPP_INFO(node->get_logger(), "%s %s %d %s %zu", one.hardware_id.c_str(), one.name.c_str(), one.level,
                            one.message.c_str(), one.values.size());
        });
    diagnostic_updater::Updater updater(node, 0.2);
    updater.setHardwareID("board");
    updater.add("link", [](diagnostic_updater::DiagnosticStatusWrapper& status) {
        status.summary(status.WARN, "slow");
        status.add("rate", 2.5);
        status.addf("count", "%d", 3);
    });
    rclcpp::spin_some(node);
    std::promise<void> never;
    rclcpp::spin_until_future_complete(node, never.get_future().share(), 300ms);
}

void use_frames(const rclcpp::Node::SharedPtr& node) {
    tf2_ros::Buffer buffer(node->get_clock());
    tf2_ros::TransformListener const listener(buffer);
    tf2_ros::StaticTransformBroadcaster fixed(node);
    tf2_ros::TransformBroadcaster moving(*node);
    geometry_msgs::msg::TransformStamped transform;
    transform.header.frame_id = "world";
    transform.child_frame_id = "base";
    transform.header.stamp = node->now();
    transform.transform.translation.x = 2.0;
    moving.sendTransform(transform);
    tf2::Quaternion turned;
    turned.setRPY(0, 0, M_PI / 2);
    transform.header.frame_id = "base";
    transform.child_frame_id = "camera";
    transform.transform.rotation = tf2::toMsg(turned);
    fixed.sendTransform(transform);
    auto const found = buffer.lookupTransform("world", "camera", tf2::TimePointZero, 1s);
    RCLCPP_INFO(node->get_logger(), "camera at %.1f yaw %.3f", found.transform.translation.x, tf2::getYaw(found.transform.rotation));
    geometry_msgs::msg::PointStamped point;
    point.header.frame_id = "camera";
    point.header.stamp = transform.header.stamp;
    point.point.x = 1.0;
    auto const moved = buffer.transform(point, "world");
    RCLCPP_INFO(node->get_logger(), "point %.1f %.1f in %s", moved.point.x, moved.point.y, moved.header.frame_id.c_str());
    try {
        buffer.lookupTransform("world", "nowhere", node->now(), rclcpp::Duration::from_seconds(0.1));
    } catch (const tf2::LookupException& error) {
        RCLCPP_INFO(node->get_logger(), "%s", error.what());
    }
}

// What a publisher and a subscription find out about each other, and the graph about both.
void use_events(const rclcpp::Node::SharedPtr& node) {
    auto const log = node->get_logger();
    rclcpp::PublisherOptions options;
    options.event_callbacks.matched_callback = [&](rclcpp::MatchedInfo& info) {
        RCLCPP_INFO(log, "matched %d of %d", static_cast<int>(info.current_count), static_cast<int>(info.total_count));
    };
    options.event_callbacks.incompatible_qos_callback = [&](rclcpp::QOSOfferedIncompatibleQoSInfo& info) {
        RCLCPP_INFO(log, "not %s", rclcpp::qos_policy_name_from_kind(info.last_policy_kind).c_str());
    };
    auto const publisher = node->create_publisher<std_msgs::msg::Int32>("seen", rclcpp::QoS(1).deadline(100ms), options);
    auto const event = node->get_graph_event();
    std::thread beside([&] {
        node->wait_for_graph_change(event, 5s);
        RCLCPP_INFO(log, "graph %d", event->check_and_clear());
    });
    rclcpp::sleep_for(50ms);
    rclcpp::SubscriptionOptions late;
    late.event_callbacks.deadline_callback = [&](rclcpp::QOSDeadlineRequestedInfo& info) {
        RCLCPP_INFO(log, "late %d", static_cast<int>(info.total_count));
    };
    auto heard = node->create_subscription<std_msgs::msg::Int32>("seen", rclcpp::QoS(1).deadline(150ms), [](const std_msgs::msg::Int32&) {}, late);
    auto const refused = node->create_subscription<std_msgs::msg::Int32>("seen", rclcpp::QoS(1).transient_local(), [](const std_msgs::msg::Int32&) {});
    beside.join();
    rclcpp::SerializedMessage bytes(0u);
    std_msgs::msg::Int32 const message;
    rclcpp::Serialization<std_msgs::msg::Int32>().serialize_message(&message, &bytes);
    publisher->publish(bytes);
    std::promise<void> never;
    auto const future = never.get_future().share();
    rclcpp::spin_until_future_complete(node, future, 200ms);
    heard.reset();
    rclcpp::spin_until_future_complete(node, future, 200ms);
}

int main(int argc, char** argv) {
    rclcpp::init(argc, argv);
    auto const managed = std::make_shared<Managed>();
    auto const node = std::make_shared<rclcpp::Node>("other");
    auto const log = node->get_logger();
    rclcpp::executors::SingleThreadedExecutor executor;
    executor.add_node(managed->get_node_base_interface());
    std::thread beside([&] { executor.spin(); });

    auto const heard = node->create_subscription<std_msgs::msg::Int32>(
        "numbers", 10, [&](const std_msgs::msg::Int32& message) { RCLCPP_INFO(log, "heard %d", message.data); });
    auto const client = node->create_client<ChangeState>("managed/change_state");
    auto change = [&](std::uint8_t to) {
        auto const request = std::make_shared<ChangeState::Request>();
        request->transition.id = to;
        auto future = client->async_send_request(request);
        rclcpp::spin_until_future_complete(node, future);
        RCLCPP_INFO(log, "%d %s", future.get()->success, managed->get_current_state().label().c_str());
    };
    change(Transition::TRANSITION_ACTIVATE);
    change(Transition::TRANSITION_CONFIGURE);
    managed->publish(1);
    change(Transition::TRANSITION_ACTIVATE);
    managed->publish(2);
    change(Transition::TRANSITION_DEACTIVATE);

    rclcpp::SyncParametersClient parameters(node, "managed");
    rclcpp::ParameterEventHandler events(node);
    auto const handle = events.add_parameter_callback(
        "level", [&](const rclcpp::Parameter& one) { RCLCPP_INFO(log, "event %ld", one.as_int()); }, "managed");
    RCLCPP_INFO(log, "level %d", parameters.get_parameter<int>("level"));
    auto const results = parameters.set_parameters({rclcpp::Parameter("level", 4), rclcpp::Parameter("level", "high")});
    RCLCPP_INFO(log, "set %d %d, has %d %d", results[0].successful, results[1].successful, parameters.has_parameter("level"),
                parameters.has_parameter("depth"));
    rclcpp::spin_some(node);

    use_frames(node);
    use_filters(node);
    use_diagnostics(node);
    use_events(node);
    executor.cancel();
    beside.join();
    return 0;
}
