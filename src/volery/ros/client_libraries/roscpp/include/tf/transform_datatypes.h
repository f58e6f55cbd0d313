// Types of tf, which are those of tf2, and their conversion to and from messages.
#pragma once
#include "tf2/exceptions.h"
#include "tf2_geometry_msgs/tf2_geometry_msgs.h"
#include "tf2_msgs/TFMessage.h"

namespace tf {

using tfMessage = tf2_msgs::TFMessage;
using tfMessagePtr = tfMessage::Ptr;
using tfMessageConstPtr = tfMessage::ConstPtr;
using tf2::ConnectivityException;
using tf2::ExtrapolationException;
using InvalidArgument = tf2::InvalidArgumentException;
using tf2::LookupException;
using tf2::Matrix3x3;
using tf2::Quaternion;
using tf2::Stamped;
using tf2::Transform;
using tf2::TransformException;
using tf2::Vector3;
using Point = Vector3;
using Pose = Transform;
using tf2::angle;
using tf2::inverse;
using tf2::length;
using tf2::quatRotate;
using tf2::slerp;
inline double tfDot(const Vector3& a, const Vector3& b) { return a.dot(b); }
inline Vector3 tfCross(const Vector3& a, const Vector3& b) { return a.cross(b); }
inline double tfDistance(const Vector3& a, const Vector3& b) { return a.distance(b); }

// A transform between two frames at a time.
class StampedTransform : public Transform {
public:
    ros::Time stamp_;
    std::string frame_id_, child_frame_id_;

    StampedTransform() = default;
    StampedTransform(const Transform& transform, const ros::Time& stamp, const std::string& frame_id,
                     const std::string& child_frame_id)
        : Transform(transform), stamp_(stamp), frame_id_(frame_id), child_frame_id_(child_frame_id) {}
    void setData(const Transform& transform) { static_cast<Transform&>(*this) = transform; }
};

inline Quaternion createQuaternionFromRPY(double roll, double pitch, double yaw) {
    Quaternion q;
    q.setRPY(roll, pitch, yaw);
    return q;
}
inline Quaternion createQuaternionFromYaw(double yaw) { return createQuaternionFromRPY(0.0, 0.0, yaw); }
inline Quaternion createIdentityQuaternion() { return Quaternion::getIdentity(); }
inline geometry_msgs::Quaternion createQuaternionMsgFromRollPitchYaw(double roll, double pitch, double yaw) {
    return tf2::toMsg(createQuaternionFromRPY(roll, pitch, yaw));
}
inline geometry_msgs::Quaternion createQuaternionMsgFromYaw(double yaw) {
    return createQuaternionMsgFromRollPitchYaw(0.0, 0.0, yaw);
}
using tf2::getYaw;

inline void quaternionMsgToTF(const geometry_msgs::Quaternion& in, Quaternion& out) {
    tf2::fromMsg(in, out);
    if (std::fabs(out.length2() - 1.0) > 0.1) {
        ROS_WARN("MSG to TF: Quaternion Not Properly Normalized");
        out.normalize();
    }
}
inline void quaternionTFToMsg(const Quaternion& in, geometry_msgs::Quaternion& out) {
    out = tf2::toMsg(std::fabs(in.length2() - 1.0) > 0.1 ? in.normalized() : in);
}
inline void vector3MsgToTF(const geometry_msgs::Vector3& in, Vector3& out) { tf2::fromMsg(in, out); }
inline void vector3TFToMsg(const Vector3& in, geometry_msgs::Vector3& out) { out = tf2::toMsg(in); }
inline void pointMsgToTF(const geometry_msgs::Point& in, Point& out) { tf2::fromMsg(in, out); }
inline void pointTFToMsg(const Point& in, geometry_msgs::Point& out) { tf2::toMsg(in, out); }
inline void transformMsgToTF(const geometry_msgs::Transform& in, Transform& out) { tf2::fromMsg(in, out); }
inline void transformTFToMsg(const Transform& in, geometry_msgs::Transform& out) { out = tf2::toMsg(in); }
inline void poseMsgToTF(const geometry_msgs::Pose& in, Pose& out) { tf2::fromMsg(in, out); }
inline void poseTFToMsg(const Pose& in, geometry_msgs::Pose& out) { tf2::toMsg(in, out); }
inline void transformStampedMsgToTF(const geometry_msgs::TransformStamped& in, StampedTransform& out) {
    out = StampedTransform(tf2::transform_of(in), in.header.stamp, in.header.frame_id, in.child_frame_id);
}
inline void transformStampedTFToMsg(const StampedTransform& in, geometry_msgs::TransformStamped& out) {
    out.header.stamp = in.stamp_;
    out.header.frame_id = in.frame_id_;
    out.child_frame_id = in.child_frame_id_;
    out.transform = tf2::toMsg(static_cast<const Transform&>(in));
}
inline void poseStampedMsgToTF(const geometry_msgs::PoseStamped& in, Stamped<Pose>& out) {
    Pose pose;
    tf2::fromMsg(in.pose, pose);
    out = Stamped<Pose>(pose, in.header.stamp, in.header.frame_id);
}
inline void poseStampedTFToMsg(const Stamped<Pose>& in, geometry_msgs::PoseStamped& out) {
    out.header.stamp = in.stamp_;
    out.header.frame_id = in.frame_id_;
    tf2::toMsg(static_cast<const Pose&>(in), out.pose);
}

// Return the name of a frame with a prefix; a name with a leading slash has none, and the slash is removed.
inline std::string resolve(const std::string& prefix, const std::string& frame) {
    if (!frame.empty() && frame.front() == '/') return frame.substr(1);
    return prefix.empty() ? frame : prefix + "/" + frame;
}

}  // namespace tf
