// Mean of attitudes: the eigenvector of a symmetric matrix of four rows by Jacobi's rotations.
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Quaternion {
    double q[4];
};
std::vector<Quaternion> attitudes;
int group;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    attitudes.resize(of(input, 120, 216, 168, 240));
    group = of(input, 6, 9, 8, 12);
    double spread = of(input, 0.1, 0.4, 0.2, 0.7);
    for (Quaternion& one : attitudes) {
        double square = 0.0, about[4] = {1.0, 0.2, -0.3, 0.1};
        for (int i = 0; i < 4; ++i) {
            one.q[i] = about[i] + numbers.between(-spread, spread);
            square += one.q[i] * one.q[i];
        }
        for (double& value : one.q)
            value /= std::sqrt(square);
    }
}

double kernel() {
    double total = 0.0;
    for (std::size_t begin = 0; begin + group <= attitudes.size(); begin += group) {
        double a[4][4] = {}, v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
        for (int k = 0; k < group; ++k)
            for (int i = 0; i < 4; ++i)
                for (int j = 0; j < 4; ++j)
                    a[i][j] += attitudes[begin + k].q[i] * attitudes[begin + k].q[j];
        for (int sweep = 0; sweep < 6; ++sweep) {
            double off = 0.0;
            for (int i = 0; i < 3; ++i)
                for (int j = i + 1; j < 4; ++j)
                    off += std::fabs(a[i][j]);
            if (off < 1e-9)
                break;
            for (int p = 0; p < 3; ++p)
                for (int q = p + 1; q < 4; ++q) {
                    if (std::fabs(a[p][q]) < 1e-12)
                        continue;
                    double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                    double t = (theta >= 0 ? 1.0 : -1.0) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
                    double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
                    for (int k = 0; k < 4; ++k) {
                        double x = a[k][p], y = a[k][q];
                        a[k][p] = c * x - s * y, a[k][q] = s * x + c * y;
                    }
                    for (int k = 0; k < 4; ++k) {
                        double x = a[p][k], y = a[q][k];
                        a[p][k] = c * x - s * y, a[q][k] = s * x + c * y;
                        x = v[k][p], y = v[k][q];
                        v[k][p] = c * x - s * y, v[k][q] = s * x + c * y;
                    }
                }
        }
        int greatest = 0;
        for (int i = 1; i < 4; ++i)
            if (a[i][i] > a[greatest][greatest])
                greatest = i;
        total += std::fabs(v[0][greatest]);
    }
    return total;
}
