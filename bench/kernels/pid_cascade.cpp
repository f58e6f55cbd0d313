// Attitude and rate loops of a multirotor: three cascades with filtered derivatives, anti-windup and a mixer.
#include <algorithm>
#include <cmath>
#include <vector>

#include "kernel.hpp"

namespace {

struct Pid {
    double kp, ki, kd, limit;
    double sum = 0.0, last = 0.0, filtered = 0.0;
    double step(double error, double dt) {
        filtered += 0.2 * ((error - last) / dt - filtered);
        last = error;
        double out = kp * error + ki * sum + kd * filtered;
        if (std::fabs(out) < limit)
            sum += error * dt;
        return std::clamp(out, -limit, limit);
    }
};

struct Sample {
    double wanted[3], angle[3], rate[3], thrust;
};

std::vector<Sample> samples;

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    samples.resize(of(input, 2000, 3000, 2500, 3500));
    double reach = of(input, 0.4, 0.9, 0.6, 0.75);
    for (Sample& sample : samples) {
        for (int axis = 0; axis < 3; ++axis) {
            sample.wanted[axis] = numbers.between(-reach, reach);
            sample.angle[axis] = numbers.between(-reach, reach);
            sample.rate[axis] = numbers.between(-2.0, 2.0);
        }
        sample.thrust = numbers.between(0.2, 0.8);
    }
}

double kernel() {
    Pid outer[3] = {{6.0, 0.5, 0.0, 4.0}, {6.0, 0.5, 0.0, 4.0}, {3.0, 0.1, 0.0, 2.0}};
    Pid inner[3] = {{0.15, 0.1, 0.003, 0.5}, {0.15, 0.1, 0.003, 0.5}, {0.2, 0.02, 0.0, 0.3}};
    double total = 0.0;
    for (const Sample& sample : samples) {
        double torque[3];
        for (int axis = 0; axis < 3; ++axis) {
            double rate = outer[axis].step(sample.wanted[axis] - sample.angle[axis], 0.0025);
            torque[axis] = inner[axis].step(rate - sample.rate[axis], 0.0025);
        }
        double motors[4] = {sample.thrust - torque[0] + torque[1] + torque[2],
                            sample.thrust + torque[0] - torque[1] + torque[2],
                            sample.thrust + torque[0] + torque[1] - torque[2],
                            sample.thrust - torque[0] - torque[1] - torque[2]};
        double most = *std::max_element(motors, motors + 4);
        if (most > 1.0)
            for (double& motor : motors)
                motor -= most - 1.0;
        for (double motor : motors)
            total += std::max(motor, 0.0);
    }
    return total;
}
