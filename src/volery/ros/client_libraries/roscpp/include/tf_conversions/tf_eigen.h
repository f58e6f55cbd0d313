// Conversion between tf's and Eigen's types.
#pragma once
#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "tf/transform_datatypes.h"

namespace tf {

inline void vectorTFToEigen(const Vector3& in, Eigen::Vector3d& out) { out = {in.x(), in.y(), in.z()}; }
inline void vectorEigenToTF(const Eigen::Vector3d& in, Vector3& out) { out = Vector3(in.x(), in.y(), in.z()); }
inline void quaternionTFToEigen(const Quaternion& in, Eigen::Quaterniond& out) {
    out = Eigen::Quaterniond(in.w(), in.x(), in.y(), in.z());
}
inline void quaternionEigenToTF(const Eigen::Quaterniond& in, Quaternion& out) {
    out = Quaternion(in.x(), in.y(), in.z(), in.w());
}
inline void matrixTFToEigen(const Matrix3x3& in, Eigen::Matrix3d& out) {
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) out(row, column) = in[row][column];
}
inline void matrixEigenToTF(const Eigen::Matrix3d& in, Matrix3x3& out) {
    out = Matrix3x3(in(0, 0), in(0, 1), in(0, 2), in(1, 0), in(1, 1), in(1, 2), in(2, 0), in(2, 1), in(2, 2));
}
// Affine3d or Isometry3d.
template <int mode>
void transformTFToEigen(const Transform& in, Eigen::Transform<double, 3, mode>& out) {
    Eigen::Matrix3d turned;
    matrixTFToEigen(in.getBasis(), turned);
    out = Eigen::Transform<double, 3, mode>::Identity();
    out.linear() = turned;
    out.translation() = Eigen::Vector3d(in.getOrigin().x(), in.getOrigin().y(), in.getOrigin().z());
}
template <int mode>
void transformEigenToTF(const Eigen::Transform<double, 3, mode>& in, Transform& out) {
    Matrix3x3 turned;
    matrixEigenToTF(in.linear(), turned);
    out = Transform(turned, Vector3(in.translation().x(), in.translation().y(), in.translation().z()));
}
template <int mode>
void poseTFToEigen(const Pose& in, Eigen::Transform<double, 3, mode>& out) {
    transformTFToEigen(in, out);
}
template <int mode>
void poseEigenToTF(const Eigen::Transform<double, 3, mode>& in, Pose& out) {
    transformEigenToTF(in, out);
}

}  // namespace tf
