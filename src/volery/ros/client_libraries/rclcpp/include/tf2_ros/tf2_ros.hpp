// tf2_ros::Buffer, listeners and broadcasters over the tree of transforms that the graph keeps.
#pragma once
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "tf2_ros/geometry.hpp"
#include "tf2_msgs/msg/tf_message.hpp"
#include "tf2/buffer_requests.h"

namespace tf2 {

// Transforms of the last *cache_time*.
class BufferCore : public BufferRequests {
public:
    explicit BufferCore(Duration cache_time = std::chrono::seconds(10)) : BufferRequests(cache_time.count()) {}

    geometry_msgs::msg::TransformStamped lookupTransform(const std::string& target, const std::string& source,
                                                         const TimePoint& time) const {
        return look_up(target, source, nanoseconds(time), 0);
    }
    geometry_msgs::msg::TransformStamped lookupTransform(const std::string& target, const TimePoint& target_time,
                                                         const std::string& source, const TimePoint& source_time,
                                                         const std::string& fixed_frame) const {
        return look_up(target, nanoseconds(target_time), source, nanoseconds(source_time), fixed_frame, 0);
    }
    bool canTransform(const std::string& target, const std::string& source, const TimePoint& time,
                      std::string* error = nullptr) const {
        return can_transform_(target, source, nanoseconds(time), 0, error);
    }

protected:
    static std::int64_t nanoseconds(const TimePoint& time) { return time.time_since_epoch().count(); }
};

}  // namespace tf2

namespace tf2_ros {

// Waits of the buffer need no timers here.
class CreateTimerInterface {
public:
    using SharedPtr = std::shared_ptr<CreateTimerInterface>;
    virtual ~CreateTimerInterface() = default;
};
class CreateTimerROS : public CreateTimerInterface {
public:
    template <class... Interfaces>
    explicit CreateTimerROS(const Interfaces&...) {}
};

class BufferInterface {
public:
    virtual ~BufferInterface() = default;
};

class Buffer : public BufferInterface, public tf2::BufferCore {
public:
    using SharedPtr = std::shared_ptr<Buffer>;
    using tf2::BufferCore::canTransform;
    using tf2::BufferCore::lookupTransform;

    explicit Buffer(rclcpp::Clock::SharedPtr, tf2::Duration cache_time = std::chrono::seconds(10))
        : BufferCore(cache_time) {}
    template <class NodeType>
    Buffer(rclcpp::Clock::SharedPtr clock, tf2::Duration cache_time, const NodeType&) : Buffer(clock, cache_time) {}

    geometry_msgs::msg::TransformStamped lookupTransform(const std::string& target, const std::string& source,
                                                         const tf2::TimePoint& time, const tf2::Duration timeout) const {
        return look_up(target, source, nanoseconds(time), timeout.count());
    }
    geometry_msgs::msg::TransformStamped lookupTransform(
        const std::string& target, const std::string& source, const rclcpp::Time& time,
        const rclcpp::Duration timeout = rclcpp::Duration(std::chrono::nanoseconds(0))) const {
        return look_up(target, source, time.nanoseconds(), timeout.nanoseconds());
    }
    geometry_msgs::msg::TransformStamped lookupTransform(
        const std::string& target, const rclcpp::Time& target_time, const std::string& source,
        const rclcpp::Time& source_time, const std::string& fixed_frame,
        const rclcpp::Duration timeout = rclcpp::Duration(std::chrono::nanoseconds(0))) const {
        return look_up(target, target_time.nanoseconds(), source, source_time.nanoseconds(), fixed_frame, timeout.nanoseconds());
    }
    bool canTransform(const std::string& target, const std::string& source, const tf2::TimePoint& time,
                      const tf2::Duration timeout, std::string* error = nullptr) const {
        return can_transform_(target, source, nanoseconds(time), timeout.count(), error);
    }
    bool canTransform(const std::string& target, const std::string& source, const rclcpp::Time& time,
                      const rclcpp::Duration timeout = rclcpp::Duration(std::chrono::nanoseconds(0)),
                      std::string* error = nullptr) const {
        return can_transform_(target, source, time.nanoseconds(), timeout.nanoseconds(), error);
    }
    template <class Message>
    Message& transform(const Message& in, Message& out, const std::string& target,
                       tf2::Duration timeout = tf2::Duration::zero()) const {
        auto const time = tf2::from_stamp(in.header.stamp);
        tf2::doTransform(in, out, lookupTransform(target, in.header.frame_id, time, timeout));
        return out;
    }
    template <class Message>
    Message transform(const Message& in, const std::string& target, tf2::Duration timeout = tf2::Duration::zero()) const {
        Message out;
        return transform(in, out, target, timeout);
    }
    void setUsingDedicatedThread(bool) {}
    void setCreateTimerInterface(CreateTimerInterface::SharedPtr) {}
    rclcpp::Clock::SharedPtr getClock() const { return std::make_shared<rclcpp::Clock>(RCL_ROS_TIME); }
};

// Fills a buffer in the background.
class TransformListener {
public:
    explicit TransformListener(tf2::BufferCore& buffer, bool = true) {
        volery::request("ros.tf_listen", volery::Writer().put(buffer.number_()));
    }
    template <class NodeType, class = decltype(rclcpp::detail::state_of(std::declval<const NodeType&>()))>
    TransformListener(tf2::BufferCore& buffer, const NodeType&, bool = true) : TransformListener(buffer) {}
};

class TransformBroadcaster {
public:
    template <class NodeType>
    explicit TransformBroadcaster(NodeType&& node, const rclcpp::QoS& qos = rclcpp::QoS(100)) {
        publisher_ = rclcpp::create_publisher<tf2_msgs::msg::TFMessage>(node, "/tf", qos);
    }
    void sendTransform(const geometry_msgs::msg::TransformStamped& transform) {
        sendTransform(std::vector<geometry_msgs::msg::TransformStamped>{transform});
    }
    void sendTransform(const std::vector<geometry_msgs::msg::TransformStamped>& transforms) {
        tf2_msgs::msg::TFMessage message;
        message.transforms = transforms;
        publisher_->publish(message);
    }

private:
    rclcpp::Publisher<tf2_msgs::msg::TFMessage>::SharedPtr publisher_;
};

// Publishes what it has published before as well, for the latched topic keeps one message.
class StaticTransformBroadcaster {
public:
    template <class NodeType>
    explicit StaticTransformBroadcaster(NodeType&& node, const rclcpp::QoS& qos = rclcpp::QoS(1).transient_local()) {
        publisher_ = rclcpp::create_publisher<tf2_msgs::msg::TFMessage>(node, "/tf_static", qos);
    }
    void sendTransform(const geometry_msgs::msg::TransformStamped& transform) {
        sendTransform(std::vector<geometry_msgs::msg::TransformStamped>{transform});
    }
    void sendTransform(const std::vector<geometry_msgs::msg::TransformStamped>& transforms) {
        tf2::merge(sent_.transforms, transforms);
        publisher_->publish(sent_);
    }

private:
    rclcpp::Publisher<tf2_msgs::msg::TFMessage>::SharedPtr publisher_;
    tf2_msgs::msg::TFMessage sent_;
};

}  // namespace tf2_ros
