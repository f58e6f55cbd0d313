// Eigen's types as messages, and transformed ones.
#pragma once
#include "eigen_conversions/eigen_msg.h"
#include "tf2_geometry_msgs/tf2_geometry_msgs.h"

namespace tf2 {

inline Eigen::Isometry3d transformToEigen(const geometry_msgs::Transform& in) {
    Eigen::Isometry3d out;
    tf::transformMsgToEigen(in, out);
    return out;
}
inline Eigen::Isometry3d transformToEigen(const geometry_msgs::TransformStamped& in) {
    return transformToEigen(in.transform);
}
template <int mode>
geometry_msgs::TransformStamped eigenToTransform(const Eigen::Transform<double, 3, mode>& in) {
    geometry_msgs::TransformStamped out;
    tf::transformEigenToMsg(in, out.transform);
    return out;
}
inline geometry_msgs::Point toMsg(const Eigen::Vector3d& in) {
    geometry_msgs::Point out;
    tf::pointEigenToMsg(in, out);
    return out;
}
inline geometry_msgs::Vector3& toMsg(const Eigen::Vector3d& in, geometry_msgs::Vector3& out) {
    tf::vectorEigenToMsg(in, out);
    return out;
}
inline void fromMsg(const geometry_msgs::Point& in, Eigen::Vector3d& out) { tf::pointMsgToEigen(in, out); }
inline void fromMsg(const geometry_msgs::Vector3& in, Eigen::Vector3d& out) { tf::vectorMsgToEigen(in, out); }
inline geometry_msgs::Quaternion toMsg(const Eigen::Quaterniond& in) {
    geometry_msgs::Quaternion out;
    tf::quaternionEigenToMsg(in, out);
    return out;
}
inline void fromMsg(const geometry_msgs::Quaternion& in, Eigen::Quaterniond& out) { tf::quaternionMsgToEigen(in, out); }
template <int mode>
geometry_msgs::Pose toMsg(const Eigen::Transform<double, 3, mode>& in) {
    geometry_msgs::Pose out;
    tf::poseEigenToMsg(in, out);
    return out;
}
template <int mode>
void fromMsg(const geometry_msgs::Pose& in, Eigen::Transform<double, 3, mode>& out) {
    tf::poseMsgToEigen(in, out);
}
inline geometry_msgs::Twist toMsg(const Eigen::Matrix<double, 6, 1>& in) {
    geometry_msgs::Twist out;
    tf::twistEigenToMsg(in, out);
    return out;
}
inline void fromMsg(const geometry_msgs::Twist& in, Eigen::Matrix<double, 6, 1>& out) { tf::twistMsgToEigen(in, out); }

inline void doTransform(const Eigen::Vector3d& in, Eigen::Vector3d& out, const geometry_msgs::TransformStamped& by) {
    out = transformToEigen(by) * in;
}
template <int mode>
void doTransform(const Eigen::Transform<double, 3, mode>& in, Eigen::Transform<double, 3, mode>& out,
                 const geometry_msgs::TransformStamped& by) {
    out = Eigen::Transform<double, 3, mode>(transformToEigen(by) * in);
}
inline void doTransform(const Eigen::Quaterniond& in, Eigen::Quaterniond& out,
                        const geometry_msgs::TransformStamped& by) {
    out = Eigen::Quaterniond(transformToEigen(by).linear()) * in;
}

}  // namespace tf2
