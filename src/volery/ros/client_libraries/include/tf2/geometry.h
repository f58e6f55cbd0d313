// Conversion between messages and tf2's types, and transformed messages. Before it is included, a client library
// names in the namespace tf2: its messages (geometry), its times (Stamp) and their conversion from and to those of
// messages (from_stamp, to_stamp), and whether a type is a message (is_message).
#pragma once
#include <cmath>
#include <string>
#include <type_traits>

#include "tf2/linear_math.h"

namespace tf2 {

// A value with a time and a frame.
template <class Value>
class Stamped : public Value {
public:
    Stamp stamp_;
    std::string frame_id_;

    Stamped() = default;
    Stamped(const Value& value, const Stamp& stamp, const std::string& frame_id)
        : Value(value), stamp_(stamp), frame_id_(frame_id) {}
    void setData(const Value& value) { static_cast<Value&>(*this) = value; }
};

inline void fromMsg(const geometry::Quaternion& in, Quaternion& out) { out = Quaternion(in.x, in.y, in.z, in.w); }
inline void fromMsg(const geometry::Vector3& in, Vector3& out) { out = Vector3(in.x, in.y, in.z); }
inline void fromMsg(const geometry::Point& in, Vector3& out) { out = Vector3(in.x, in.y, in.z); }
inline void fromMsg(const geometry::Transform& in, Transform& out) {
    out = Transform(Quaternion(in.rotation.x, in.rotation.y, in.rotation.z, in.rotation.w),
                    Vector3(in.translation.x, in.translation.y, in.translation.z));
}
inline void fromMsg(const geometry::Pose& in, Transform& out) {
    out = Transform(Quaternion(in.orientation.x, in.orientation.y, in.orientation.z, in.orientation.w),
                    Vector3(in.position.x, in.position.y, in.position.z));
}

template <class Message>
void put_parts(const Vector3& in, Message& out) {
    out.x = in.x();
    out.y = in.y();
    out.z = in.z();
}
inline geometry::Quaternion toMsg(const Quaternion& in) {
    geometry::Quaternion out;
    out.x = in.x();
    out.y = in.y();
    out.z = in.z();
    out.w = in.w();
    return out;
}
inline geometry::Vector3 toMsg(const Vector3& in) {
    geometry::Vector3 out;
    put_parts(in, out);
    return out;
}
inline geometry::Point& toMsg(const Vector3& in, geometry::Point& out) {
    put_parts(in, out);
    return out;
}
inline geometry::Transform toMsg(const Transform& in) {
    geometry::Transform out;
    put_parts(in.getOrigin(), out.translation);
    out.rotation = toMsg(in.getRotation());
    return out;
}
inline geometry::Pose& toMsg(const Transform& in, geometry::Pose& out) {
    put_parts(in.getOrigin(), out.position);
    out.orientation = toMsg(in.getRotation());
    return out;
}
inline geometry::TransformStamped toMsg(const Stamped<Transform>& in) {
    geometry::TransformStamped out;
    out.header.stamp = to_stamp(in.stamp_);
    out.header.frame_id = in.frame_id_;
    out.transform = toMsg(static_cast<const Transform&>(in));
    return out;
}
inline void fromMsg(const geometry::TransformStamped& in, Stamped<Transform>& out) {
    out.stamp_ = from_stamp(in.header.stamp);
    out.frame_id_ = in.header.frame_id;
    fromMsg(in.transform, static_cast<Transform&>(out));
}

// Messages to values and back, whichever of both the arguments are.
template <class From, class To>
void convert(const From& from, To& to) {
    if constexpr (std::is_same_v<From, To>)
        to = from;
    else if constexpr (is_message<From>::value)
        fromMsg(from, to);
    else if constexpr (std::is_same_v<From, Vector3> && std::is_same_v<To, geometry::Point>)
        toMsg(from, to);
    else if constexpr (std::is_same_v<From, Transform> && std::is_same_v<To, geometry::Pose>)
        toMsg(from, to);
    else
        to = toMsg(from);
}

inline Transform transform_of(const geometry::TransformStamped& message) {
    Transform found;
    fromMsg(message.transform, found);
    return found;
}
// Other packages specialise it for their messages.
template <class Message>
void doTransform(const Message& in, Message& out, const geometry::TransformStamped& by);
inline void doTransform(const geometry::Point& in, geometry::Point& out,
                        const geometry::TransformStamped& by) {
    Vector3 const moved = transform_of(by) * Vector3(in.x, in.y, in.z);
    put_parts(moved, out);
}
inline void doTransform(const geometry::Vector3& in, geometry::Vector3& out,
                        const geometry::TransformStamped& by) {
    put_parts(transform_of(by).getBasis() * Vector3(in.x, in.y, in.z), out);
}
inline void doTransform(const geometry::Quaternion& in, geometry::Quaternion& out,
                        const geometry::TransformStamped& by) {
    Quaternion by_rotation, own;
    fromMsg(by.transform.rotation, by_rotation);
    fromMsg(in, own);
    out = toMsg(by_rotation * own);
}
inline void doTransform(const geometry::Pose& in, geometry::Pose& out,
                        const geometry::TransformStamped& by) {
    Transform own;
    fromMsg(in, own);
    toMsg(transform_of(by) * own, out);
}
inline void doTransform(const geometry::PointStamped& in, geometry::PointStamped& out,
                        const geometry::TransformStamped& by) {
    doTransform(in.point, out.point, by);
    out.header = by.header;
}
inline void doTransform(const geometry::Vector3Stamped& in, geometry::Vector3Stamped& out,
                        const geometry::TransformStamped& by) {
    doTransform(in.vector, out.vector, by);
    out.header = by.header;
}
inline void doTransform(const geometry::QuaternionStamped& in, geometry::QuaternionStamped& out,
                        const geometry::TransformStamped& by) {
    doTransform(in.quaternion, out.quaternion, by);
    out.header = by.header;
}
inline void doTransform(const geometry::PoseStamped& in, geometry::PoseStamped& out,
                        const geometry::TransformStamped& by) {
    doTransform(in.pose, out.pose, by);
    out.header = by.header;
}
inline void doTransform(const geometry::TransformStamped& in, geometry::TransformStamped& out,
                        const geometry::TransformStamped& by) {
    out.transform = toMsg(transform_of(by) * transform_of(in));
    out.header = by.header;
}

// The angle about z, for a quaternion of tf2 or of a message.
inline double getYaw(const Quaternion& q) {
    return std::atan2(2.0 * (q.x() * q.y() + q.w() * q.z()),
                      q.w() * q.w() + q.x() * q.x() - q.y() * q.y() - q.z() * q.z());
}
inline double getYaw(const geometry::Quaternion& q) { return getYaw(Quaternion(q.x, q.y, q.z, q.w)); }
inline void getEulerYPR(const Quaternion& q, double& yaw, double& pitch, double& roll) {
    Matrix3x3(q).getEulerYPR(yaw, pitch, roll);
}
inline void getEulerYPR(const geometry::Quaternion& q, double& yaw, double& pitch, double& roll) {
    getEulerYPR(Quaternion(q.x, q.y, q.z, q.w), yaw, pitch, roll);
}

}  // namespace tf2
