// Products and inverses of small dense matrices, sizes known at run time only, with partial pivoting.
#include <cmath>
#include <utility>
#include <vector>

#include "kernel.hpp"

namespace {

struct Matrix {
    int n;
    std::vector<double> a;
    explicit Matrix(int size) : n(size), a(size * size) {}
    double& at(int i, int j) { return a[i * n + j]; }
    double at(int i, int j) const { return a[i * n + j]; }
};

std::vector<Matrix> inputs;

Matrix product(const Matrix& x, const Matrix& y) {
    Matrix out(x.n);
    for (int i = 0; i < x.n; ++i)
        for (int k = 0; k < x.n; ++k) {
            double factor = x.at(i, k);
            for (int j = 0; j < x.n; ++j)
                out.at(i, j) += factor * y.at(k, j);
        }
    return out;
}

Matrix inverse(Matrix m) {
    Matrix out(m.n);
    for (int i = 0; i < m.n; ++i)
        out.at(i, i) = 1.0;
    for (int column = 0; column < m.n; ++column) {
        int pivot = column;
        for (int row = column + 1; row < m.n; ++row)
            if (std::fabs(m.at(row, column)) > std::fabs(m.at(pivot, column)))
                pivot = row;
        for (int j = 0; j < m.n; ++j) {
            std::swap(m.at(pivot, j), m.at(column, j));
            std::swap(out.at(pivot, j), out.at(column, j));
        }
        double scale = 1.0 / m.at(column, column);
        for (int j = 0; j < m.n; ++j) {
            m.at(column, j) *= scale;
            out.at(column, j) *= scale;
        }
        for (int row = 0; row < m.n; ++row) {
            double factor = m.at(row, column);
            if (row == column || factor == 0.0)
                continue;
            for (int j = 0; j < m.n; ++j) {
                m.at(row, j) -= factor * m.at(column, j);
                out.at(row, j) -= factor * out.at(column, j);
            }
        }
    }
    return out;
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    inputs.clear();
    for (int i = 0; i < 16; ++i) {
        Matrix m(of(input, 6 + i % 7, 9 + i % 8, 4 + i % 10, 5 + i % 9));
        for (double& value : m.a)
            value = numbers.between(-1.0, 1.0);
        for (int k = 0; k < m.n; ++k)
            m.at(k, k) += 3.0;
        inputs.push_back(std::move(m));
    }
}

double kernel() {
    double total = 0.0;
    for (int repeat = 0; repeat < 4; ++repeat)
        for (const Matrix& m : inputs) {
            Matrix back = product(inverse(m), m);
            total += back.at(0, 0) + back.at(1, 0);
        }
    return total;
}
