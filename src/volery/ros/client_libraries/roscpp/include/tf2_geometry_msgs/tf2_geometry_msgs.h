// Conversion between messages and tf2's types, and transformed messages.
#pragma once
#include "geometry_msgs/PointStamped.h"
#include "geometry_msgs/PoseStamped.h"
#include "geometry_msgs/QuaternionStamped.h"
#include "geometry_msgs/TransformStamped.h"
#include "geometry_msgs/Vector3Stamped.h"
#include "ros/ros.h"
#include "tf2/linear_math.h"

namespace tf2 {

// A value with a time and a frame.
template <class Value>
class Stamped : public Value {
public:
    ros::Time stamp_;
    std::string frame_id_;

    Stamped() = default;
    Stamped(const Value& value, const ros::Time& stamp, const std::string& frame_id)
        : Value(value), stamp_(stamp), frame_id_(frame_id) {}
    void setData(const Value& value) { static_cast<Value&>(*this) = value; }
};

inline void fromMsg(const geometry_msgs::Quaternion& in, Quaternion& out) { out = Quaternion(in.x, in.y, in.z, in.w); }
inline void fromMsg(const geometry_msgs::Vector3& in, Vector3& out) { out = Vector3(in.x, in.y, in.z); }
inline void fromMsg(const geometry_msgs::Point& in, Vector3& out) { out = Vector3(in.x, in.y, in.z); }
inline void fromMsg(const geometry_msgs::Transform& in, Transform& out) {
    out = Transform(Quaternion(in.rotation.x, in.rotation.y, in.rotation.z, in.rotation.w),
                    Vector3(in.translation.x, in.translation.y, in.translation.z));
}
inline void fromMsg(const geometry_msgs::Pose& in, Transform& out) {
    out = Transform(Quaternion(in.orientation.x, in.orientation.y, in.orientation.z, in.orientation.w),
                    Vector3(in.position.x, in.position.y, in.position.z));
}

template <class Message>
void put_parts(const Vector3& in, Message& out) {
    out.x = in.x();
    out.y = in.y();
    out.z = in.z();
}
inline geometry_msgs::Quaternion toMsg(const Quaternion& in) {
    geometry_msgs::Quaternion out;
    out.x = in.x();
    out.y = in.y();
    out.z = in.z();
    out.w = in.w();
    return out;
}
inline geometry_msgs::Vector3 toMsg(const Vector3& in) {
    geometry_msgs::Vector3 out;
    put_parts(in, out);
    return out;
}
inline geometry_msgs::Point& toMsg(const Vector3& in, geometry_msgs::Point& out) {
    put_parts(in, out);
    return out;
}
inline geometry_msgs::Transform toMsg(const Transform& in) {
    geometry_msgs::Transform out;
    put_parts(in.getOrigin(), out.translation);
    out.rotation = toMsg(in.getRotation());
    return out;
}
inline geometry_msgs::Pose& toMsg(const Transform& in, geometry_msgs::Pose& out) {
    put_parts(in.getOrigin(), out.position);
    out.orientation = toMsg(in.getRotation());
    return out;
}
inline geometry_msgs::TransformStamped toMsg(const Stamped<Transform>& in) {
    geometry_msgs::TransformStamped out;
    out.header.stamp = in.stamp_;
    out.header.frame_id = in.frame_id_;
    out.transform = toMsg(static_cast<const Transform&>(in));
    return out;
}
inline void fromMsg(const geometry_msgs::TransformStamped& in, Stamped<Transform>& out) {
    out.stamp_ = in.header.stamp;
    out.frame_id_ = in.header.frame_id;
    fromMsg(in.transform, static_cast<Transform&>(out));
}

// Messages to values and back, whichever of both the arguments are.
template <class From, class To>
void convert(const From& from, To& to) {
    if constexpr (std::is_same_v<From, To>)
        to = from;
    else if constexpr (ros::is_message<From>::value)
        fromMsg(from, to);
    else if constexpr (std::is_same_v<From, Vector3> && std::is_same_v<To, geometry_msgs::Point>)
        toMsg(from, to);
    else if constexpr (std::is_same_v<From, Transform> && std::is_same_v<To, geometry_msgs::Pose>)
        toMsg(from, to);
    else
        to = toMsg(from);
}

inline Transform transform_of(const geometry_msgs::TransformStamped& message) {
    Transform found;
    fromMsg(message.transform, found);
    return found;
}
inline void doTransform(const geometry_msgs::Point& in, geometry_msgs::Point& out,
                        const geometry_msgs::TransformStamped& by) {
    Vector3 const moved = transform_of(by) * Vector3(in.x, in.y, in.z);
    put_parts(moved, out);
}
inline void doTransform(const geometry_msgs::Vector3& in, geometry_msgs::Vector3& out,
                        const geometry_msgs::TransformStamped& by) {
    put_parts(transform_of(by).getBasis() * Vector3(in.x, in.y, in.z), out);
}
inline void doTransform(const geometry_msgs::Quaternion& in, geometry_msgs::Quaternion& out,
                        const geometry_msgs::TransformStamped& by) {
    Quaternion by_rotation, own;
    fromMsg(by.transform.rotation, by_rotation);
    fromMsg(in, own);
    out = toMsg(by_rotation * own);
}
inline void doTransform(const geometry_msgs::Pose& in, geometry_msgs::Pose& out,
                        const geometry_msgs::TransformStamped& by) {
    Transform own;
    fromMsg(in, own);
    toMsg(transform_of(by) * own, out);
}
inline void doTransform(const geometry_msgs::PointStamped& in, geometry_msgs::PointStamped& out,
                        const geometry_msgs::TransformStamped& by) {
    doTransform(in.point, out.point, by);
    out.header = by.header;
}
inline void doTransform(const geometry_msgs::Vector3Stamped& in, geometry_msgs::Vector3Stamped& out,
                        const geometry_msgs::TransformStamped& by) {
    doTransform(in.vector, out.vector, by);
    out.header = by.header;
}
inline void doTransform(const geometry_msgs::QuaternionStamped& in, geometry_msgs::QuaternionStamped& out,
                        const geometry_msgs::TransformStamped& by) {
    doTransform(in.quaternion, out.quaternion, by);
    out.header = by.header;
}
inline void doTransform(const geometry_msgs::PoseStamped& in, geometry_msgs::PoseStamped& out,
                        const geometry_msgs::TransformStamped& by) {
    doTransform(in.pose, out.pose, by);
    out.header = by.header;
}
inline void doTransform(const geometry_msgs::TransformStamped& in, geometry_msgs::TransformStamped& out,
                        const geometry_msgs::TransformStamped& by) {
    out.transform = toMsg(transform_of(by) * transform_of(in));
    out.header = by.header;
}

// The angle about z, for a quaternion of tf2 or of a message.
inline double getYaw(const Quaternion& q) {
    return std::atan2(2.0 * (q.x() * q.y() + q.w() * q.z()),
                      q.w() * q.w() + q.x() * q.x() - q.y() * q.y() - q.z() * q.z());
}
inline double getYaw(const geometry_msgs::Quaternion& q) { return getYaw(Quaternion(q.x, q.y, q.z, q.w)); }
inline void getEulerYPR(const Quaternion& q, double& yaw, double& pitch, double& roll) {
    Matrix3x3(q).getEulerYPR(yaw, pitch, roll);
}
inline void getEulerYPR(const geometry_msgs::Quaternion& q, double& yaw, double& pitch, double& roll) {
    getEulerYPR(Quaternion(q.x, q.y, q.z, q.w), yaw, pitch, roll);
}

}  // namespace tf2
