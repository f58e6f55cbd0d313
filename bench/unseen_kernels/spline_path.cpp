// A path through waypoints as cubic splines: the tridiagonal system solved, speed and curvature sampled.
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<double> points[3];
std::vector<double> second[3], upper, rest;
int samples;

void solve(const std::vector<double>& p, std::vector<double>& m) {
    int n = static_cast<int>(p.size());
    upper[0] = rest[0] = 0;
    for (int i = 1; i < n - 1; ++i) {
        double pivot = 4.0 - upper[i - 1];
        upper[i] = 1.0 / pivot;
        rest[i] = (6.0 * (p[i + 1] - 2 * p[i] + p[i - 1]) - rest[i - 1]) / pivot;
    }
    m[n - 1] = 0;
    for (int i = n - 2; i > 0; --i)
        m[i] = rest[i] - upper[i] * m[i + 1];
    m[0] = 0;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    int count = of(input, 24, 40, 30, 36);
    samples = of(input, 20, 12, 16, 25);
    for (int axis = 0; axis < 3; ++axis) {
        points[axis].resize(count);
        second[axis].assign(count, 0);
        double at = 0;
        for (double& one : points[axis])
            one = at += numbers.between(axis == 2 ? -3 : -5, axis == 2 ? 3 : 20);
    }
    upper.assign(count, 0);
    rest.assign(count, 0);
}

double kernel() {
    int count = static_cast<int>(points[0].size());
    for (int axis = 0; axis < 3; ++axis)
        solve(points[axis], second[axis]);
    double length = 0, sharpest = 0, time = 0;
    for (int i = 0; i + 1 < count; ++i)
        for (int s = 0; s < samples; ++s) {
            double t = (s + 0.5) / samples, u = 1 - t;
            double v[3], a[3];
            for (int axis = 0; axis < 3; ++axis) {
                const double* p = &points[axis][i];
                const double* m = &second[axis][i];
                v[axis] = p[1] - p[0] + ((3 * t * t - 1) * m[1] - (3 * u * u - 1) * m[0]) / 6;
                a[axis] = u * m[0] + t * m[1];
            }
            double cross[3] = {v[1] * a[2] - v[2] * a[1], v[2] * a[0] - v[0] * a[2],
                               v[0] * a[1] - v[1] * a[0]};
            double speed = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
            double bend = std::sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]) /
                          (speed * speed * speed + 1e-9);
            double allowed = std::fmin(15.0, std::sqrt(4.0 / (bend + 1e-6)));
            length += speed / samples;
            time += speed / samples / allowed;
            sharpest = bend > sharpest ? bend : sharpest;
        }
    return length + time + sharpest;
}
