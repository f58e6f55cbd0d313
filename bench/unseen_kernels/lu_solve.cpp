// Inverse dynamics of an arm of six joints: LU with partial pivoting of 6 by 6 matrices, two right-hand sides each.
#include <cmath>
#include <utility>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
constexpr int N = 6;
struct Problem {
    double matrix[N][N];
    double sides[2][N];
};
std::vector<Problem> problems;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    problems.resize(of(input, 120, 200, 150, 260));
    double diagonal = of(input, 0.5, 3.0, 1.0, 0.2);
    for (Problem& one : problems) {
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < N; ++j)
                one.matrix[i][j] = numbers.between(-1.0, 1.0) + (i == j ? diagonal : 0.0);
        for (auto& side : one.sides)
            for (double& value : side)
                value = numbers.between(-5.0, 5.0);
    }
}

double kernel() {
    double total = 0.0;
    for (const Problem& one : problems) {
        double lu[N][N];
        int order[N];
        for (int i = 0; i < N; ++i) {
            order[i] = i;
            for (int j = 0; j < N; ++j)
                lu[i][j] = one.matrix[i][j];
        }
        for (int k = 0; k < N; ++k) {
            int best = k;
            for (int i = k + 1; i < N; ++i)
                if (std::fabs(lu[i][k]) > std::fabs(lu[best][k]))
                    best = i;
            if (best != k) {
                std::swap(order[k], order[best]);
                for (int j = 0; j < N; ++j)
                    std::swap(lu[k][j], lu[best][j]);
            }
            for (int i = k + 1; i < N; ++i) {
                lu[i][k] /= lu[k][k];
                for (int j = k + 1; j < N; ++j)
                    lu[i][j] -= lu[i][k] * lu[k][j];
            }
        }
        for (const auto& side : one.sides) {
            double x[N];
            for (int i = 0; i < N; ++i) {
                x[i] = side[order[i]];
                for (int j = 0; j < i; ++j)
                    x[i] -= lu[i][j] * x[j];
            }
            for (int i = N - 1; i >= 0; --i) {
                for (int j = i + 1; j < N; ++j)
                    x[i] -= lu[i][j] * x[j];
                x[i] /= lu[i][i];
            }
            total += x[0] + x[N - 1];
        }
    }
    return total;
}
