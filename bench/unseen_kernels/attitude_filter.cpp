// A gradient-descent attitude filter: gyroscope and accelerometer samples into a quaternion, one after the other.
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Sample {
    float rate[3], force[3];
};
std::vector<Sample> samples;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    samples.resize(of(input, 1500, 2500, 2000, 3000));
    double shaking = of(input, 0.1, 0.5, 0.3, 0.2);
    for (Sample& one : samples)
        for (int axis = 0; axis < 3; ++axis) {
            one.rate[axis] = static_cast<float>(numbers.between(-1.0, 1.0));
            one.force[axis] = static_cast<float>((axis == 2 ? 9.81 : 0.0) + numbers.between(-shaking, shaking));
        }
}

double kernel() {
    float w = 1.0f, x = 0.0f, y = 0.0f, z = 0.0f;
    const float gain = 0.05f, step = 0.005f;
    for (const Sample& one : samples) {
        float ax = one.force[0], ay = one.force[1], az = one.force[2];
        float norm = 1.0f / std::sqrt(ax * ax + ay * ay + az * az);
        ax *= norm, ay *= norm, az *= norm;
        float f1 = 2.0f * (x * z - w * y) - ax, f2 = 2.0f * (w * x + y * z) - ay;
        float f3 = 1.0f - 2.0f * (x * x + y * y) - az;
        float gw = -2.0f * y * f1 + 2.0f * x * f2;
        float gx = 2.0f * z * f1 + 2.0f * w * f2 - 4.0f * x * f3;
        float gy = -2.0f * w * f1 + 2.0f * z * f2 - 4.0f * y * f3;
        float gz = 2.0f * x * f1 + 2.0f * y * f2;
        norm = gain / std::sqrt(gw * gw + gx * gx + gy * gy + gz * gz + 1e-12f);
        float p = one.rate[0], q = one.rate[1], r = one.rate[2];
        float dw = 0.5f * (-x * p - y * q - z * r) - norm * gw, dx = 0.5f * (w * p + y * r - z * q) - norm * gx;
        float dy = 0.5f * (w * q - x * r + z * p) - norm * gy, dz = 0.5f * (w * r + x * q - y * p) - norm * gz;
        w += dw * step, x += dx * step, y += dy * step, z += dz * step;
        norm = 1.0f / std::sqrt(w * w + x * x + y * y + z * z);
        w *= norm, x *= norm, y *= norm, z *= norm;
    }
    return w + 2.0 * x + 3.0 * y + 4.0 * z;
}
