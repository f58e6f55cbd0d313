// tf2_ros::Buffer, listeners and broadcasters over the tree of transforms that the graph keeps.
#pragma once
#include <string>
#include <vector>

#include "tf2/exceptions.h"
#include "tf2_geometry_msgs/tf2_geometry_msgs.h"
#include "tf2_msgs/TFMessage.h"

namespace tf2 {

// Transforms of the last *cache_time*.
class BufferCore {
public:
    explicit BufferCore(ros::Duration cache_time = ros::Duration(10.0)) : cache_(cache_time) {}
    BufferCore(const BufferCore&) = delete;
    BufferCore& operator=(const BufferCore&) = delete;
    virtual ~BufferCore() = default;

    bool setTransform(const geometry_msgs::TransformStamped& transform, const std::string&, bool is_static = false) {
        auto const with = volery::Writer().put(number_()).put(ros::detail::to_bytes(transform)).put(is_static);
        return volery::request("ros.tf_set", with).flag();
    }
    void clear() { volery::request("ros.tf_clear", volery::Writer().put(number_())); }
    std::string allFramesAsString() const { return volery::request("ros.tf_frames", volery::Writer().put(number_())).text(); }

    // With a time-out wait until the transform is available. Throws a TransformException if it is not.
    geometry_msgs::TransformStamped lookupTransform(const std::string& target, const std::string& source,
                                                    const ros::Time& time,
                                                    const ros::Duration timeout = ros::Duration(0.0)) const {
        return found(about(target, source, time, timeout));
    }
    geometry_msgs::TransformStamped lookupTransform(const std::string& target, const ros::Time& target_time,
                                                    const std::string& source, const ros::Time& source_time,
                                                    const std::string& fixed_frame,
                                                    const ros::Duration timeout = ros::Duration(0.0)) const {
        auto const first = lookupTransform(fixed_frame, source, source_time, timeout);
        auto last = lookupTransform(target, fixed_frame, target_time, timeout);
        last.transform = toMsg(transform_of(last) * transform_of(first));
        last.child_frame_id = source;
        return last;
    }
    bool canTransform(const std::string& target, const std::string& source, const ros::Time& time,
                      std::string* error = nullptr) const {
        return canTransform(target, source, time, ros::Duration(0.0), error);
    }
    bool canTransform(const std::string& target, const std::string& source, const ros::Time& time,
                      const ros::Duration timeout, std::string* error = nullptr) const {
        auto const reason = volery::request("ros.tf_can", about(target, source, time, timeout)).text();
        if (error != nullptr) *error = reason;
        return reason.empty();
    }
    bool canTransform(const std::string& target, const ros::Time& target_time, const std::string& source,
                      const ros::Time& source_time, const std::string& fixed_frame,
                      const ros::Duration timeout = ros::Duration(0.0), std::string* error = nullptr) const {
        return canTransform(fixed_frame, source, source_time, timeout, error) &&
               canTransform(target, fixed_frame, target_time, timeout, error);
    }

    // Number of the tree on the graph, which is made at its first use.
    std::int64_t number_() const {
        if (number < 0) number = volery::request("ros.tf_buffer", volery::Writer().put(cache_.toNSec())).integer();
        return number;
    }

private:
    volery::Writer about(const std::string& target, const std::string& source, const ros::Time& time,
                         const ros::Duration& timeout) const {
        auto const at = static_cast<std::int64_t>(time.toNSec());
        return volery::Writer().put(number_()).put(target).put(source).put(at).put(timeout.toNSec());
    }
    static geometry_msgs::TransformStamped found(const volery::Writer& with) {
        auto answer = volery::request("ros.tf_look_up", with);
        if (!answer.flag()) {
            auto const kind = answer.text();
            detail::raise(kind, answer.text());
        }
        geometry_msgs::TransformStamped made;
        ros::detail::from_bytes(answer, made);
        return made;
    }
    ros::Duration cache_;
    mutable std::int64_t number = -1;
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
        for (const auto& transform : transforms) {
            auto same = [&](const auto& one) { return one.child_frame_id == transform.child_frame_id; };
            auto const before = std::find_if(sent_.transforms.begin(), sent_.transforms.end(), same);
            if (before != sent_.transforms.end())
                *before = transform;
            else
                sent_.transforms.push_back(transform);
        }
        publisher_.publish(sent_);
    }

private:
    ros::Publisher publisher_;
    tf2_msgs::TFMessage sent_;
};

}  // namespace tf2_ros
