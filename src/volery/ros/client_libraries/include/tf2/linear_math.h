// Vectors, quaternions, rotation matrices and transforms with the interface of tf2/LinearMath.
#pragma once
#include <cmath>
#include <limits>
#include <ostream>

using tf2Scalar = double;
using tfScalar = double;

namespace tf2 {

class Vector3 {
public:
    double m_floats[4] = {0.0, 0.0, 0.0, 0.0};

    Vector3() = default;
    Vector3(double x, double y, double z) : m_floats{x, y, z, 0.0} {}

    double x() const { return m_floats[0]; }
    double y() const { return m_floats[1]; }
    double z() const { return m_floats[2]; }
    const double& getX() const { return m_floats[0]; }
    const double& getY() const { return m_floats[1]; }
    const double& getZ() const { return m_floats[2]; }
    void setX(double x) { m_floats[0] = x; }
    void setY(double y) { m_floats[1] = y; }
    void setZ(double z) { m_floats[2] = z; }
    void setValue(double x, double y, double z) { *this = Vector3(x, y, z); }
    void setZero() { *this = Vector3(); }
    operator double*() { return m_floats; }
    operator const double*() const { return m_floats; }

    Vector3& operator+=(const Vector3& v) { return *this = Vector3(x() + v.x(), y() + v.y(), z() + v.z()); }
    Vector3& operator-=(const Vector3& v) { return *this = Vector3(x() - v.x(), y() - v.y(), z() - v.z()); }
    Vector3& operator*=(double s) { return *this = Vector3(x() * s, y() * s, z() * s); }
    Vector3& operator/=(double s) { return *this *= 1.0 / s; }
    bool operator==(const Vector3& v) const { return x() == v.x() && y() == v.y() && z() == v.z(); }
    bool operator!=(const Vector3& v) const { return !(*this == v); }

    double dot(const Vector3& v) const { return x() * v.x() + y() * v.y() + z() * v.z(); }
    Vector3 cross(const Vector3& v) const {
        return {y() * v.z() - z() * v.y(), z() * v.x() - x() * v.z(), x() * v.y() - y() * v.x()};
    }
    double length2() const { return dot(*this); }
    double length() const { return std::sqrt(length2()); }
    double distance2(const Vector3& v) const;
    double distance(const Vector3& v) const { return std::sqrt(distance2(v)); }
    Vector3& normalize() { return *this /= length(); }
    Vector3 normalized() const { return Vector3(*this).normalize(); }
    double angle(const Vector3& v) const { return std::acos(dot(v) / std::sqrt(length2() * v.length2())); }
    Vector3 absolute() const { return {std::fabs(x()), std::fabs(y()), std::fabs(z())}; }
    bool isZero() const { return x() == 0.0 && y() == 0.0 && z() == 0.0; }
    Vector3 rotate(const Vector3& axis, double angle) const;
    Vector3 lerp(const Vector3& v, double t) const;
};

inline Vector3 operator+(Vector3 a, const Vector3& b) { return a += b; }
inline Vector3 operator-(Vector3 a, const Vector3& b) { return a -= b; }
inline Vector3 operator-(const Vector3& v) { return {-v.x(), -v.y(), -v.z()}; }
inline Vector3 operator*(const Vector3& a, const Vector3& b) { return {a.x() * b.x(), a.y() * b.y(), a.z() * b.z()}; }
inline Vector3 operator*(Vector3 v, double s) { return v *= s; }
inline Vector3 operator*(double s, Vector3 v) { return v *= s; }
inline Vector3 operator/(Vector3 v, double s) { return v /= s; }
inline double Vector3::distance2(const Vector3& v) const { return (v - *this).length2(); }
inline Vector3 Vector3::lerp(const Vector3& v, double t) const { return *this + (v - *this) * t; }
inline Vector3 Vector3::rotate(const Vector3& axis, double angle) const {
    Vector3 const along = axis * axis.dot(*this), across = *this - along;
    return along + across * std::cos(angle) + axis.cross(*this) * std::sin(angle);
}
inline double tf2Dot(const Vector3& a, const Vector3& b) { return a.dot(b); }
inline Vector3 tf2Cross(const Vector3& a, const Vector3& b) { return a.cross(b); }
inline double tf2Distance(const Vector3& a, const Vector3& b) { return a.distance(b); }

class Quaternion {
public:
    double m_floats[4] = {0.0, 0.0, 0.0, 0.0};

    Quaternion() = default;
    Quaternion(double x, double y, double z, double w) : m_floats{x, y, z, w} {}
    Quaternion(const Vector3& axis, double angle) { setRotation(axis, angle); }
    Quaternion(double yaw, double pitch, double roll) { setEuler(yaw, pitch, roll); }
    static Quaternion getIdentity() { return {0.0, 0.0, 0.0, 1.0}; }

    double x() const { return m_floats[0]; }
    double y() const { return m_floats[1]; }
    double z() const { return m_floats[2]; }
    double w() const { return m_floats[3]; }
    const double& getX() const { return m_floats[0]; }
    const double& getY() const { return m_floats[1]; }
    const double& getZ() const { return m_floats[2]; }
    const double& getW() const { return m_floats[3]; }
    void setX(double x) { m_floats[0] = x; }
    void setY(double y) { m_floats[1] = y; }
    void setZ(double z) { m_floats[2] = z; }
    void setW(double w) { m_floats[3] = w; }
    void setValue(double x, double y, double z, double w) { *this = Quaternion(x, y, z, w); }
    double operator[](int index) const { return m_floats[index]; }
    double& operator[](int index) { return m_floats[index]; }

    void setRotation(const Vector3& axis, double angle) {
        double const s = std::sin(angle * 0.5) / axis.length();
        setValue(axis.x() * s, axis.y() * s, axis.z() * s, std::cos(angle * 0.5));
    }
    // Rotations about the fixed axes: roll about x, then pitch about y, then yaw about z.
    void setRPY(double roll, double pitch, double yaw) {
        *this = Quaternion(Vector3(0, 0, 1), yaw) * Quaternion(Vector3(0, 1, 0), pitch) *
                Quaternion(Vector3(1, 0, 0), roll);
    }
    void setEulerZYX(double yaw, double pitch, double roll) { setRPY(roll, pitch, yaw); }
    // Yaw about y, then pitch about x, then roll about z, each in the rotated axes.
    void setEuler(double yaw, double pitch, double roll) {
        *this = Quaternion(Vector3(0, 1, 0), yaw) * Quaternion(Vector3(1, 0, 0), pitch) *
                Quaternion(Vector3(0, 0, 1), roll);
    }

    Quaternion operator*(const Quaternion& q) const {
        return {w() * q.x() + x() * q.w() + y() * q.z() - z() * q.y(),
                w() * q.y() + y() * q.w() + z() * q.x() - x() * q.z(),
                w() * q.z() + z() * q.w() + x() * q.y() - y() * q.x(),
                w() * q.w() - x() * q.x() - y() * q.y() - z() * q.z()};
    }
    Quaternion operator*(double s) const { return {x() * s, y() * s, z() * s, w() * s}; }
    Quaternion operator/(double s) const { return *this * (1.0 / s); }
    Quaternion operator+(const Quaternion& q) const { return {x() + q.x(), y() + q.y(), z() + q.z(), w() + q.w()}; }
    Quaternion operator-(const Quaternion& q) const { return *this + -q; }
    Quaternion operator-() const { return *this * -1.0; }
    Quaternion& operator*=(const Quaternion& q) { return *this = *this * q; }
    Quaternion& operator*=(double s) { return *this = *this * s; }
    Quaternion& operator/=(double s) { return *this = *this / s; }
    Quaternion& operator+=(const Quaternion& q) { return *this = *this + q; }
    Quaternion& operator-=(const Quaternion& q) { return *this = *this - q; }
    bool operator==(const Quaternion& q) const {
        return x() == q.x() && y() == q.y() && z() == q.z() && w() == q.w();
    }
    bool operator!=(const Quaternion& q) const { return !(*this == q); }

    double dot(const Quaternion& q) const { return x() * q.x() + y() * q.y() + z() * q.z() + w() * q.w(); }
    double length2() const { return dot(*this); }
    double length() const { return std::sqrt(length2()); }
    Quaternion& normalize() { return *this /= length(); }
    Quaternion normalized() const { return *this / length(); }
    Quaternion inverse() const { return {-x(), -y(), -z(), w()}; }
    double getAngle() const { return 2.0 * std::acos(w()); }
    double getAngleShortestPath() const { return 2.0 * std::acos(w() < 0 ? -w() : w()); }
    Vector3 getAxis() const {
        double const s2 = 1.0 - w() * w();
        if (s2 < 10.0 * std::numeric_limits<double>::epsilon()) return {1.0, 0.0, 0.0};
        return Vector3(x(), y(), z()) / std::sqrt(s2);
    }
    double angle(const Quaternion& q) const { return std::acos(dot(q) / std::sqrt(length2() * q.length2())); }
    double angleShortestPath(const Quaternion& q) const {
        return 2.0 * std::acos(std::fabs(dot(q)) / std::sqrt(length2() * q.length2()));
    }
    Quaternion slerp(const Quaternion& q, double t) const {
        double const theta = angleShortestPath(q) / 2.0;
        if (theta == 0.0 || std::isnan(theta)) return *this;
        double const own = std::sin((1.0 - t) * theta) / std::sin(theta), other = std::sin(t * theta) / std::sin(theta);
        return *this * own + q * (dot(q) < 0.0 ? -other : other);
    }
};

inline Quaternion operator*(double s, const Quaternion& q) { return q * s; }
inline double dot(const Quaternion& a, const Quaternion& b) { return a.dot(b); }
inline double length(const Quaternion& q) { return q.length(); }
inline double angle(const Quaternion& a, const Quaternion& b) { return a.angle(b); }
inline double angleShortestPath(const Quaternion& a, const Quaternion& b) { return a.angleShortestPath(b); }
inline Quaternion inverse(const Quaternion& q) { return q.inverse(); }
inline Quaternion slerp(const Quaternion& a, const Quaternion& b, double t) { return a.slerp(b, t); }
inline Vector3 quatRotate(const Quaternion& q, const Vector3& v) {
    Quaternion const turned = q * Quaternion(v.x(), v.y(), v.z(), 0.0) * q.inverse();
    return {turned.x(), turned.y(), turned.z()};
}

class Matrix3x3 {
public:
    Matrix3x3() = default;
    explicit Matrix3x3(const Quaternion& q) { setRotation(q); }
    Matrix3x3(double xx, double xy, double xz, double yx, double yy, double yz, double zx, double zy, double zz) {
        setValue(xx, xy, xz, yx, yy, yz, zx, zy, zz);
    }
    static Matrix3x3 getIdentity() { return {1, 0, 0, 0, 1, 0, 0, 0, 1}; }

    void setValue(double xx, double xy, double xz, double yx, double yy, double yz, double zx, double zy, double zz) {
        rows_[0] = {xx, xy, xz};
        rows_[1] = {yx, yy, yz};
        rows_[2] = {zx, zy, zz};
    }
    void setIdentity() { *this = getIdentity(); }
    const Vector3& operator[](int row) const { return rows_[row]; }
    Vector3& operator[](int row) { return rows_[row]; }
    const Vector3& getRow(int row) const { return rows_[row]; }
    Vector3 getColumn(int at) const { return {rows_[0][at], rows_[1][at], rows_[2][at]}; }

    void setRotation(const Quaternion& q) {
        double const s = 2.0 / q.length2(), x = q.x() * s, y = q.y() * s, z = q.z() * s;
        double const wx = q.w() * x, wy = q.w() * y, wz = q.w() * z;
        double const xx = q.x() * x, xy = q.x() * y, xz = q.x() * z, yy = q.y() * y, yz = q.y() * z, zz = q.z() * z;
        setValue(1.0 - (yy + zz), xy - wz, xz + wy, xy + wz, 1.0 - (xx + zz), yz - wx, xz - wy, yz + wx,
                 1.0 - (xx + yy));
    }
    void getRotation(Quaternion& q) const {
        double const trace = rows_[0][0] + rows_[1][1] + rows_[2][2];
        double part[4];
        if (trace > 0.0) {
            double s = std::sqrt(trace + 1.0);
            part[3] = s * 0.5;
            s = 0.5 / s;
            for (int i = 0; i < 3; ++i) {
                int const j = (i + 1) % 3, k = (i + 2) % 3;
                part[i] = (rows_[k][j] - rows_[j][k]) * s;
            }
        } else {
            int i = rows_[0][0] < rows_[1][1] ? 1 : 0;
            if (rows_[i][i] < rows_[2][2]) i = 2;
            int const j = (i + 1) % 3, k = (i + 2) % 3;
            double s = std::sqrt(rows_[i][i] - rows_[j][j] - rows_[k][k] + 1.0);
            part[i] = s * 0.5;
            s = 0.5 / s;
            part[3] = (rows_[k][j] - rows_[j][k]) * s;
            part[j] = (rows_[j][i] + rows_[i][j]) * s;
            part[k] = (rows_[k][i] + rows_[i][k]) * s;
        }
        q.setValue(part[0], part[1], part[2], part[3]);
    }
    void setRPY(double roll, double pitch, double yaw) {
        Quaternion q;
        q.setRPY(roll, pitch, yaw);
        setRotation(q);
    }
    void setEulerYPR(double yaw, double pitch, double roll) { setRPY(roll, pitch, yaw); }
    void setEulerZYX(double roll, double pitch, double yaw) { setRPY(roll, pitch, yaw); }
    // Of the two solutions the second one has the pitch beyond a right angle.
    void getEulerYPR(double& yaw, double& pitch, double& roll, unsigned int solution = 1) const {
        if (std::fabs(rows_[2][0]) >= 1.0) {
            yaw = 0.0;
            double const delta = std::atan2(rows_[2][1], rows_[2][2]);
            pitch = rows_[2][0] < 0.0 ? M_PI / 2.0 : -M_PI / 2.0;
            roll = delta;
            return;
        }
        pitch = -std::asin(rows_[2][0]);
        if (solution != 1) pitch = M_PI - pitch;
        double const c = std::cos(pitch);
        roll = std::atan2(rows_[2][1] / c, rows_[2][2] / c);
        yaw = std::atan2(rows_[1][0] / c, rows_[0][0] / c);
    }
    void getRPY(double& roll, double& pitch, double& yaw, unsigned int solution = 1) const {
        getEulerYPR(yaw, pitch, roll, solution);
    }
    void getEulerZYX(double& yaw, double& pitch, double& roll, unsigned int solution = 1) const {
        getEulerYPR(yaw, pitch, roll, solution);
    }

    Matrix3x3 transpose() const {
        return {rows_[0][0], rows_[1][0], rows_[2][0], rows_[0][1], rows_[1][1],
                rows_[2][1], rows_[0][2], rows_[1][2], rows_[2][2]};
    }
    double determinant() const { return rows_[0].dot(rows_[1].cross(rows_[2])); }
    Matrix3x3 inverse() const {
        Vector3 const a = rows_[1].cross(rows_[2]), b = rows_[2].cross(rows_[0]), c = rows_[0].cross(rows_[1]);
        double const s = 1.0 / determinant();
        return {a[0] * s, b[0] * s, c[0] * s, a[1] * s, b[1] * s, c[1] * s, a[2] * s, b[2] * s, c[2] * s};
    }
    Vector3 operator*(const Vector3& v) const { return {rows_[0].dot(v), rows_[1].dot(v), rows_[2].dot(v)}; }
    Matrix3x3 operator*(const Matrix3x3& other) const {
        Matrix3x3 made;
        for (int row = 0; row < 3; ++row)
            for (int at = 0; at < 3; ++at) made.rows_[row][at] = rows_[row].dot(other.getColumn(at));
        return made;
    }
    Matrix3x3& operator*=(const Matrix3x3& other) { return *this = *this * other; }
    bool operator==(const Matrix3x3& other) const {
        return rows_[0] == other.rows_[0] && rows_[1] == other.rows_[1] && rows_[2] == other.rows_[2];
    }

private:
    Vector3 rows_[3];
};

class Transform {
public:
    Transform() = default;
    explicit Transform(const Quaternion& q, const Vector3& origin = Vector3()) : basis_(q), origin_(origin) {}
    explicit Transform(const Matrix3x3& basis, const Vector3& origin = Vector3()) : basis_(basis), origin_(origin) {}
    static Transform getIdentity() { return Transform(Matrix3x3::getIdentity()); }

    Vector3& getOrigin() { return origin_; }
    const Vector3& getOrigin() const { return origin_; }
    Matrix3x3& getBasis() { return basis_; }
    const Matrix3x3& getBasis() const { return basis_; }
    Quaternion getRotation() const {
        Quaternion q;
        basis_.getRotation(q);
        return q;
    }
    void setOrigin(const Vector3& origin) { origin_ = origin; }
    void setBasis(const Matrix3x3& basis) { basis_ = basis; }
    void setRotation(const Quaternion& q) { basis_.setRotation(q); }
    void setIdentity() { *this = getIdentity(); }

    Vector3 operator()(const Vector3& v) const { return basis_ * v + origin_; }
    Vector3 operator*(const Vector3& v) const { return (*this)(v); }
    Quaternion operator*(const Quaternion& q) const { return getRotation() * q; }
    Transform operator*(const Transform& t) const { return Transform(basis_ * t.basis_, (*this)(t.origin_)); }
    Transform& operator*=(const Transform& t) { return *this = *this * t; }
    Transform inverse() const {
        Matrix3x3 const back = basis_.transpose();
        return Transform(back, back * -origin_);
    }
    Transform inverseTimes(const Transform& t) const { return inverse() * t; }
    bool operator==(const Transform& t) const { return basis_ == t.basis_ && origin_ == t.origin_; }

private:
    Matrix3x3 basis_;
    Vector3 origin_;
};

}  // namespace tf2
