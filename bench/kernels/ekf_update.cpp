// A Kalman filter of position, velocity and heading in the plane: predict with odometry, correct with GPS.
#include <cmath>
#include <vector>

#include "kernel.hpp"

namespace {

constexpr int N = 5;
using Matrix = double[N][N];

struct Reading {
    double acceleration, turn, gps[2];
    bool has_gps;
};

std::vector<Reading> readings;

void multiply(const Matrix a, const Matrix b, Matrix out) {
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = 0.0;
            for (int k = 0; k < N; ++k)
                sum += a[i][k] * b[k][j];
            out[i][j] = sum;
        }
}

void multiply_transposed(const Matrix a, const Matrix b, Matrix out) {
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) {
            double sum = 0.0;
            for (int k = 0; k < N; ++k)
                sum += a[i][k] * b[j][k];
            out[i][j] = sum;
        }
}

void correct(double* x, Matrix p, int row, double measured, double noise) {
    double s = p[row][row] + noise, gain[N], old[N];
    for (int i = 0; i < N; ++i) {
        gain[i] = p[i][row] / s;
        old[i] = p[row][i];
    }
    double innovation = measured - x[row];
    for (int i = 0; i < N; ++i) {
        x[i] += gain[i] * innovation;
        for (int j = 0; j < N; ++j)
            p[i][j] -= gain[i] * old[j];
    }
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    readings.resize(of(input, 600, 900, 750, 1100));
    int every = of(input, 10, 4, 6, 8);  // GPS more often than when calibrating
    int count = 0;
    for (Reading& reading : readings) {
        reading = {numbers.between(-1, 1), numbers.between(-0.5, 0.5), {}, count++ % every == 0};
        reading.gps[0] = numbers.between(-1.0, 1.0);
        reading.gps[1] = numbers.between(-1.0, 1.0);
    }
}

double kernel() {
    double x[N] = {0, 0, 0.3, 1.0, 0.0};
    Matrix p = {}, f = {}, half, next;
    for (int i = 0; i < N; ++i)
        p[i][i] = f[i][i] = 1.0;
    const double dt = 0.02;
    for (const Reading& reading : readings) {
        double c = std::cos(x[2]), s = std::sin(x[2]);
        x[0] += x[3] * c * dt;
        x[1] += x[3] * s * dt;
        x[2] = std::remainder(x[2] + (reading.turn + x[4]) * dt, 2.0 * M_PI);
        x[3] += reading.acceleration * dt;
        f[0][2] = -x[3] * s * dt;
        f[0][3] = c * dt;
        f[1][2] = x[3] * c * dt;
        f[1][3] = s * dt;
        f[2][4] = dt;
        multiply(f, p, half);
        multiply_transposed(half, f, next);
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < N; ++j)
                p[i][j] = next[i][j] + (i == j ? 1e-3 : 0.0);
        if (reading.has_gps) {
            correct(x, p, 0, reading.gps[0], 0.5);
            correct(x, p, 1, reading.gps[1], 0.5);
        }
    }
    return x[0] + x[1] + x[2] + x[3];
}
