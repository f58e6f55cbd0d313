// Conversion between messages and Eigen's types.
#pragma once
#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "geometry_msgs/Point.h"
#include "geometry_msgs/Pose.h"
#include "geometry_msgs/Quaternion.h"
#include "geometry_msgs/Transform.h"
#include "geometry_msgs/Twist.h"
#include "geometry_msgs/Vector3.h"
#include "geometry_msgs/Wrench.h"
#include "std_msgs/Float64MultiArray.h"

namespace tf {
namespace eigen_detail {

using Six = Eigen::Matrix<double, 6, 1>;

template <class Message>
Eigen::Vector3d vector(const Message& message) {
    return {message.x, message.y, message.z};
}
template <class Message>
void put(const Eigen::Vector3d& in, Message& out) {
    out.x = in.x();
    out.y = in.y();
    out.z = in.z();
}
inline Eigen::Quaterniond rotation(const geometry_msgs::Quaternion& in) { return {in.w, in.x, in.y, in.z}; }
inline void put(const Eigen::Quaterniond& in, geometry_msgs::Quaternion& out) {
    out.x = in.x();
    out.y = in.y();
    out.z = in.z();
    out.w = in.w();
}
template <class Rigid>
void compose(const Eigen::Vector3d& at, const Eigen::Quaterniond& turned, Rigid& out) {
    out = Eigen::Translation3d(at) * turned;
}
// The rotation with a real part that is not negative, as tf has it.
template <class Rigid>
Eigen::Quaterniond rotation_of(const Rigid& in) {
    Eigen::Quaterniond turned(in.linear());
    if (turned.w() < 0) turned.coeffs() *= -1.0;
    return turned;
}

}  // namespace eigen_detail

inline void pointMsgToEigen(const geometry_msgs::Point& in, Eigen::Vector3d& out) { out = eigen_detail::vector(in); }
inline void pointEigenToMsg(const Eigen::Vector3d& in, geometry_msgs::Point& out) { eigen_detail::put(in, out); }
inline void vectorMsgToEigen(const geometry_msgs::Vector3& in, Eigen::Vector3d& out) { out = eigen_detail::vector(in); }
inline void vectorEigenToMsg(const Eigen::Vector3d& in, geometry_msgs::Vector3& out) { eigen_detail::put(in, out); }
inline void quaternionMsgToEigen(const geometry_msgs::Quaternion& in, Eigen::Quaterniond& out) {
    out = eigen_detail::rotation(in);
}
inline void quaternionEigenToMsg(const Eigen::Quaterniond& in, geometry_msgs::Quaternion& out) {
    eigen_detail::put(in, out);
}
// Affine3d or Isometry3d.
template <int mode>
void poseMsgToEigen(const geometry_msgs::Pose& in, Eigen::Transform<double, 3, mode>& out) {
    eigen_detail::compose(eigen_detail::vector(in.position), eigen_detail::rotation(in.orientation), out);
}
template <int mode>
void poseEigenToMsg(const Eigen::Transform<double, 3, mode>& in, geometry_msgs::Pose& out) {
    eigen_detail::put(in.translation(), out.position);
    eigen_detail::put(eigen_detail::rotation_of(in), out.orientation);
}
template <int mode>
void transformMsgToEigen(const geometry_msgs::Transform& in, Eigen::Transform<double, 3, mode>& out) {
    eigen_detail::compose(eigen_detail::vector(in.translation), eigen_detail::rotation(in.rotation), out);
}
template <int mode>
void transformEigenToMsg(const Eigen::Transform<double, 3, mode>& in, geometry_msgs::Transform& out) {
    eigen_detail::put(in.translation(), out.translation);
    eigen_detail::put(eigen_detail::rotation_of(in), out.rotation);
}
inline void twistMsgToEigen(const geometry_msgs::Twist& in, eigen_detail::Six& out) {
    out << eigen_detail::vector(in.linear), eigen_detail::vector(in.angular);
}
inline void twistEigenToMsg(const eigen_detail::Six& in, geometry_msgs::Twist& out) {
    eigen_detail::put(in.head<3>(), out.linear);
    eigen_detail::put(in.tail<3>(), out.angular);
}
inline void wrenchMsgToEigen(const geometry_msgs::Wrench& in, eigen_detail::Six& out) {
    out << eigen_detail::vector(in.force), eigen_detail::vector(in.torque);
}
inline void wrenchEigenToMsg(const eigen_detail::Six& in, geometry_msgs::Wrench& out) {
    eigen_detail::put(in.head<3>(), out.force);
    eigen_detail::put(in.tail<3>(), out.torque);
}
template <class Derived>
void matrixEigenToMsg(const Eigen::MatrixBase<Derived>& in, std_msgs::Float64MultiArray& out) {
    auto const rows = static_cast<std::uint32_t>(in.rows()), columns = static_cast<std::uint32_t>(in.cols());
    out.layout.dim.resize(2);
    out.layout.dim[0].size = rows;
    out.layout.dim[0].stride = rows * columns;
    out.layout.dim[1].size = out.layout.dim[1].stride = columns;
    out.data.clear();
    for (Eigen::Index row = 0; row < in.rows(); ++row)
        for (Eigen::Index column = 0; column < in.cols(); ++column) out.data.push_back(in(row, column));
}

}  // namespace tf
