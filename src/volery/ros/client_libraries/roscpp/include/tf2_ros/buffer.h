// tf2_ros::Buffer, listeners and broadcasters over the tree of transforms that the graph keeps.
#pragma once
#include <string>
#include <vector>

#include "tf2_geometry_msgs/tf2_geometry_msgs.h"
#include "tf2/buffer_requests.h"
#include "tf2_msgs/TFMessage.h"

namespace tf2 {

// Transforms of the last *cache_time*.
class BufferCore : public BufferRequests {
public:
    explicit BufferCore(ros::Duration cache_time = ros::Duration(10.0)) : BufferRequests(cache_time.toNSec()) {}

    geometry_msgs::TransformStamped lookupTransform(const std::string& target, const std::string& source,
                                                    const ros::Time& time,
                                                    const ros::Duration timeout = ros::Duration(0.0)) const {
        return look_up(target, source, nanoseconds(time), timeout.toNSec());
    }
    geometry_msgs::TransformStamped lookupTransform(const std::string& target, const ros::Time& target_time,
                                                    const std::string& source, const ros::Time& source_time,
                                                    const std::string& fixed_frame,
                                                    const ros::Duration timeout = ros::Duration(0.0)) const {
        return look_up(target, nanoseconds(target_time), source, nanoseconds(source_time), fixed_frame, timeout.toNSec());
    }
    bool canTransform(const std::string& target, const std::string& source, const ros::Time& time,
                      std::string* error = nullptr) const {
        return canTransform(target, source, time, ros::Duration(0.0), error);
    }
    bool canTransform(const std::string& target, const std::string& source, const ros::Time& time,
                      const ros::Duration timeout, std::string* error = nullptr) const {
        return can_transform_(target, source, nanoseconds(time), timeout.toNSec(), error);
    }
    bool canTransform(const std::string& target, const ros::Time& target_time, const std::string& source,
                      const ros::Time& source_time, const std::string& fixed_frame,
                      const ros::Duration timeout = ros::Duration(0.0), std::string* error = nullptr) const {
        return canTransform(fixed_frame, source, source_time, timeout, error) &&
               canTransform(target, fixed_frame, target_time, timeout, error);
    }

private:
    static std::int64_t nanoseconds(const ros::Time& time) { return static_cast<std::int64_t>(time.toNSec()); }
};

}  // namespace tf2

namespace tf2_ros {

class Buffer : public tf2::BufferCore {
public:
    explicit Buffer(ros::Duration cache_time = ros::Duration(10.0), bool = false) : BufferCore(cache_time) {}
    Buffer(ros::Duration cache_time, const ros::NodeHandle&) : BufferCore(cache_time) {}

    template <class Message>
    Message& transform(const Message& in, Message& out, const std::string& target,
                       ros::Duration timeout = ros::Duration(0.0)) const {
        tf2::doTransform(in, out, lookupTransform(target, in.header.frame_id, in.header.stamp, timeout));
        return out;
    }
    template <class Message>
    Message transform(const Message& in, const std::string& target, ros::Duration timeout = ros::Duration(0.0)) const {
        Message out;
        return transform(in, out, target, timeout);
    }
    void setUsingDedicatedThread(bool) {}
};

// Fills a buffer in the background.
class TransformListener {
public:
    explicit TransformListener(tf2::BufferCore& buffer, bool = true, ros::TransportHints = ros::TransportHints()) {
        volery::request("ros.tf_listen", volery::Writer().put(buffer.number_()));
    }
    TransformListener(tf2::BufferCore& buffer, const ros::NodeHandle&, bool = true,
                      ros::TransportHints = ros::TransportHints())
        : TransformListener(buffer) {}
};

class TransformBroadcaster {
public:
    TransformBroadcaster() { publisher_ = ros::NodeHandle().advertise<tf2_msgs::TFMessage>("/tf", 100); }
    void sendTransform(const geometry_msgs::TransformStamped& transform) {
        sendTransform(std::vector<geometry_msgs::TransformStamped>{transform});
    }
    void sendTransform(const std::vector<geometry_msgs::TransformStamped>& transforms) {
        tf2_msgs::TFMessage message;
        message.transforms = transforms;
        publisher_.publish(message);
    }

private:
    ros::Publisher publisher_;
};

// Publishes what it has published before as well, for the latched topic keeps one message.
class StaticTransformBroadcaster {
public:
    StaticTransformBroadcaster() {
        publisher_ = ros::NodeHandle().advertise<tf2_msgs::TFMessage>("/tf_static", 100, true);
    }
    void sendTransform(const geometry_msgs::TransformStamped& transform) {
        sendTransform(std::vector<geometry_msgs::TransformStamped>{transform});
    }
    void sendTransform(const std::vector<geometry_msgs::TransformStamped>& transforms) {
        tf2::merge(sent_.transforms, transforms);
        publisher_.publish(sent_);
    }

private:
    ros::Publisher publisher_;
    tf2_msgs::TFMessage sent_;
};

}  // namespace tf2_ros
