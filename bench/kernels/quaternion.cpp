// Integrates gyro rates as a quaternion and rotates measured vectors into the world.
#include <cmath>
#include <vector>

#include "kernel.hpp"

namespace {

struct Vector {
    double x, y, z;
};

struct Quaternion {
    double w, x, y, z;
};

std::vector<Vector> rates, vectors;
int vectors_each;

Quaternion product(const Quaternion& a, const Quaternion& b) {
    return {a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

Vector cross(const Vector& a, const Vector& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

Vector rotate(const Quaternion& q, const Vector& v) {
    Vector axis{q.x, q.y, q.z}, once = cross(axis, v);
    Vector twice = cross(axis, {once.x + q.w * v.x, once.y + q.w * v.y, once.z + q.w * v.z});
    return {v.x + 2.0 * twice.x, v.y + 2.0 * twice.y, v.z + 2.0 * twice.z};
}

Vector any(Numbers& numbers, double reach) {
    return {numbers.between(-reach, reach), numbers.between(-reach, reach), numbers.between(-reach, reach)};
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    vectors_each = of(input, 5, 12, 8, 17);
    rates.clear();
    vectors.clear();
    for (int i = 0; i < 1500; ++i)
        rates.push_back(any(numbers, 3.0));
    for (int i = 0; i < vectors_each; ++i)
        vectors.push_back(any(numbers, 9.81));
}

double kernel() {
    Quaternion q{1, 0, 0, 0};
    double total = 0.0;
    for (const Vector& rate : rates) {
        const double half = 0.5 * 0.005;
        Quaternion change = product(q, {0.0, rate.x * half, rate.y * half, rate.z * half});
        q = {q.w + change.w, q.x + change.x, q.y + change.y, q.z + change.z};
        double norm = 1.0 / std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
        q = {q.w * norm, q.x * norm, q.y * norm, q.z * norm};
        for (const Vector& vector : vectors) {
            Vector world = rotate(q, vector);
            total += world.z > 0.0 ? world.x : world.y;
        }
    }
    return total;
}
