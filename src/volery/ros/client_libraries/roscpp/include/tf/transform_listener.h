// tf::TransformListener, a buffer that fills itself.
#pragma once
#include "tf/transform_datatypes.h"
#include "tf2_ros/buffer.h"

namespace tf {

class Transformer {
public:
    explicit Transformer(bool = true, ros::Duration cache_time = ros::Duration(10.0)) : core_(cache_time) {}
    virtual ~Transformer() = default;

    void lookupTransform(const std::string& target, const std::string& source, const ros::Time& time,
                         StampedTransform& found) const {
        auto const message = core_.lookupTransform(plain(target), plain(source), time);
        transformStampedMsgToTF(message, found);
        found.frame_id_ = target;
        found.child_frame_id_ = source;
    }
    void lookupTransform(const std::string& target, const ros::Time& target_time, const std::string& source,
                         const ros::Time& source_time, const std::string& fixed_frame, StampedTransform& found) const {
        auto const message =
            core_.lookupTransform(plain(target), target_time, plain(source), source_time, plain(fixed_frame));
        transformStampedMsgToTF(message, found);
    }
    bool waitForTransform(const std::string& target, const std::string& source, const ros::Time& time,
                          const ros::Duration& timeout, const ros::Duration& = ros::Duration(0.01),
                          std::string* error = nullptr) const {
        return core_.canTransform(plain(target), plain(source), time, timeout, error);
    }
    bool waitForTransform(const std::string& target, const ros::Time& target_time, const std::string& source,
                          const ros::Time& source_time, const std::string& fixed_frame, const ros::Duration& timeout,
                          const ros::Duration& = ros::Duration(0.01), std::string* error = nullptr) const {
        return core_.canTransform(plain(target), target_time, plain(source), source_time, plain(fixed_frame), timeout,
                                    error);
    }
    bool canTransform(const std::string& target, const std::string& source, const ros::Time& time,
                      std::string* error = nullptr) const {
        return core_.canTransform(plain(target), plain(source), time, error);
    }
    bool frameExists(const std::string& frame) const {
        return ("\n" + core_.allFramesAsString()).find("\nFrame " + plain(frame) + " exists") != std::string::npos;
    }
    std::string allFramesAsString() const { return core_.allFramesAsString(); }
    bool setTransform(const StampedTransform& transform, const std::string& authority = "") {
        geometry_msgs::TransformStamped message;
        transformStampedTFToMsg(transform, message);
        return core_.setTransform(message, authority);
    }
    void clear() { core_.clear(); }
    tf2_ros::Buffer& buffer_() { return core_; }

    // The argument in another frame, at its own time.
    template <class Value>
    void transform_value(const std::string& target, const Stamped<Value>& in, Stamped<Value>& out) const {
        StampedTransform by;
        lookupTransform(target, in.frame_id_, in.stamp_, by);
        auto const moved = static_cast<const Transform&>(by) * static_cast<const Value&>(in);
        out = Stamped<Value>(moved, by.stamp_, target);
    }
    void transformPoint(const std::string& target, const Stamped<Point>& in, Stamped<Point>& out) const {
        transform_value(target, in, out);
    }
    void transformPose(const std::string& target, const Stamped<Pose>& in, Stamped<Pose>& out) const {
        transform_value(target, in, out);
    }
    void transformQuaternion(const std::string& target, const Stamped<Quaternion>& in, Stamped<Quaternion>& out) const {
        transform_value(target, in, out);
    }
    template <class Message>
    void transform_message(const std::string& target, const Message& in, Message& out) const {
        auto const by = core_.lookupTransform(plain(target), plain(in.header.frame_id), in.header.stamp);
        tf2::doTransform(in, out, by);
        out.header.frame_id = target;
    }
    void transformPoint(const std::string& target, const geometry_msgs::PointStamped& in,
                        geometry_msgs::PointStamped& out) const {
        transform_message(target, in, out);
    }
    void transformPose(const std::string& target, const geometry_msgs::PoseStamped& in,
                       geometry_msgs::PoseStamped& out) const {
        transform_message(target, in, out);
    }
    void transformVector(const std::string& target, const geometry_msgs::Vector3Stamped& in,
                         geometry_msgs::Vector3Stamped& out) const {
        transform_message(target, in, out);
    }
    void transformQuaternion(const std::string& target, const geometry_msgs::QuaternionStamped& in,
                             geometry_msgs::QuaternionStamped& out) const {
        transform_message(target, in, out);
    }

protected:
    static std::string plain(const std::string& frame) { return resolve("", frame); }
    tf2_ros::Buffer core_;
};

class TransformListener : public Transformer {
public:
    explicit TransformListener(ros::Duration cache_time = ros::Duration(10.0), bool = true)
        : Transformer(true, cache_time), listener_(core_) {}
    explicit TransformListener(const ros::NodeHandle&, ros::Duration cache_time = ros::Duration(10.0), bool = true)
        : TransformListener(cache_time) {}
    bool ok() const { return ros::ok(); }
    std::string resolve(const std::string& frame) const { return plain(frame); }

private:
    tf2_ros::TransformListener listener_;
};

class TransformBroadcaster {
public:
    void sendTransform(const StampedTransform& transform) {
        sendTransform(std::vector<StampedTransform>{transform});
    }
    void sendTransform(const std::vector<StampedTransform>& transforms) {
        std::vector<geometry_msgs::TransformStamped> messages(transforms.size());
        for (std::size_t index = 0; index < transforms.size(); ++index)
            transformStampedTFToMsg(transforms[index], messages[index]);
        sendTransform(messages);
    }
    void sendTransform(const geometry_msgs::TransformStamped& transform) {
        sendTransform(std::vector<geometry_msgs::TransformStamped>{transform});
    }
    void sendTransform(std::vector<geometry_msgs::TransformStamped> transforms) {
        for (auto& transform : transforms) {
            transform.header.frame_id = resolve("", transform.header.frame_id);
            transform.child_frame_id = resolve("", transform.child_frame_id);
        }
        broadcaster_.sendTransform(transforms);
    }

private:
    tf2_ros::TransformBroadcaster broadcaster_;
};

}  // namespace tf
