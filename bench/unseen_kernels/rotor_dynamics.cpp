// Integrates the motion of a multirotor by Runge-Kutta of fourth order: each step depends on the one before.
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
constexpr int STATES = 10;  // position, speed, quaternion
std::vector<double> thrusts;
double drag;

void slope(const double* s, double thrust, double* out) {
    double w = s[6], x = s[7], y = s[8], z = s[9];
    double up[3] = {2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)};
    double speed = std::sqrt(s[3] * s[3] + s[4] * s[4] + s[5] * s[5]);
    for (int axis = 0; axis < 3; ++axis) {
        out[axis] = s[3 + axis];
        out[3 + axis] = up[axis] * thrust - drag * speed * s[3 + axis];
    }
    out[5] -= 9.81;
    double p = 0.1 * thrust - 1.0, q = 0.3, r = -0.2;
    out[6] = 0.5 * (-x * p - y * q - z * r);
    out[7] = 0.5 * (w * p + y * r - z * q);
    out[8] = 0.5 * (w * q - x * r + z * p);
    out[9] = 0.5 * (w * r + x * q - y * p);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    thrusts.resize(of(input, 300, 500, 400, 600));
    drag = of(input, 0.05, 0.2, 0.1, 0.15);
    for (double& one : thrusts)
        one = numbers.between(9.0, 11.0);
}

double kernel() {
    double state[STATES] = {0, 0, 10, 1, 0, 0, 1, 0, 0, 0};
    const double step = 0.01;
    for (double thrust : thrusts) {
        double k[4][STATES], at[STATES];
        slope(state, thrust, k[0]);
        for (int stage = 1; stage < 4; ++stage) {
            for (int i = 0; i < STATES; ++i)
                at[i] = state[i] + (stage == 3 ? step : step / 2.0) * k[stage - 1][i];
            slope(at, thrust, k[stage]);
        }
        for (int i = 0; i < STATES; ++i)
            state[i] += step / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    }
    return state[0] + state[1] + state[2];
}
