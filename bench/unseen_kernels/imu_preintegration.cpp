// Preintegrates gyroscope and accelerometer between two key frames: rotation matrix, speed, position, covariance.
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Sample {
    double rate[3], force[3];
};
std::vector<Sample> samples;
constexpr int SIZE = 9;

void rotated(const double from[9], const double angle[3], double to[9]) {
    double x = angle[0], y = angle[1], z = angle[2];
    double square = x * x + y * y + z * z, size = std::sqrt(square);
    double first = size < 1e-9 ? 1.0 : std::sin(size) / size, second = size < 1e-9 ? 0.5 : (1.0 - std::cos(size)) / square;
    double step[9] = {1.0 - second * (y * y + z * z), second * x * y - first * z, second * x * z + first * y,
                      second * x * y + first * z, 1.0 - second * (x * x + z * z), second * y * z - first * x,
                      second * x * z - first * y, second * y * z + first * x, 1.0 - second * (x * x + y * y)};
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) {
            double sum = 0.0;
            for (int k = 0; k < 3; ++k)
                sum += from[3 * row + k] * step[3 * k + column];
            to[3 * row + column] = sum;
        }
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    samples.resize(of(input, 60, 100, 80, 120));
    for (Sample& one : samples)
        for (int axis = 0; axis < 3; ++axis) {
            one.rate[axis] = numbers.between(-1.0, 1.0);
            one.force[axis] = numbers.between(-3.0, 3.0) + (axis == 2 ? 9.81 : 0.0);
        }
}

double kernel() {
    const double dt = 0.005;
    double turn[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, speed[3] = {0, 0, 0}, place[3] = {0, 0, 0};
    double covariance[SIZE][SIZE] = {};
    for (const Sample& one : samples) {
        double force[3], next[9], angle[3];
        for (int row = 0; row < 3; ++row) {
            force[row] = 0.0;
            for (int k = 0; k < 3; ++k)
                force[row] += turn[3 * row + k] * one.force[k];
            angle[row] = one.rate[row] * dt;
        }
        double change[SIZE][SIZE] = {}, product[SIZE][SIZE], updated[SIZE][SIZE];
        for (int i = 0; i < SIZE; ++i)
            change[i][i] = 1.0;
        for (int i = 0; i < 3; ++i) {
            change[6 + i][3 + i] = dt;
            change[3 + i][(i + 1) % 3] = force[(i + 2) % 3] * dt;
            change[3 + i][(i + 2) % 3] = -force[(i + 1) % 3] * dt;
        }
        for (int row = 0; row < SIZE; ++row)
            for (int column = 0; column < SIZE; ++column) {
                double sum = 0.0;
                for (int k = 0; k < SIZE; ++k)
                    sum += change[row][k] * covariance[k][column];
                product[row][column] = sum;
            }
        for (int row = 0; row < SIZE; ++row)
            for (int column = 0; column < SIZE; ++column) {
                double sum = row == column ? 1e-6 : 0.0;
                for (int k = 0; k < SIZE; ++k)
                    sum += product[row][k] * change[column][k];
                updated[row][column] = sum;
            }
        for (int row = 0; row < SIZE; ++row)
            for (int column = 0; column < SIZE; ++column)
                covariance[row][column] = updated[row][column];
        for (int axis = 0; axis < 3; ++axis) {
            place[axis] += speed[axis] * dt + 0.5 * force[axis] * dt * dt;
            speed[axis] += force[axis] * dt;
        }
        rotated(turn, angle, next);
        for (int i = 0; i < 9; ++i)
            turn[i] = next[i];
    }
    return place[0] + place[1] + place[2] + covariance[8][8] + turn[0];
}
