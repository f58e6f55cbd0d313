// Solves small symmetric systems, as a factor-graph or a calibration does: LDL' of 12 by 12 and two substitutions.
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
constexpr int SIZE = 12;
struct Problem {
    double matrix[SIZE][SIZE], right[SIZE];
};
std::vector<Problem> problems;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    problems.resize(of(input, 30, 40, 35, 50));
    for (Problem& one : problems)
        for (int row = 0; row < SIZE; ++row) {
            for (int column = 0; column <= row; ++column)
                one.matrix[row][column] = one.matrix[column][row] = numbers.between(-1.0, 1.0);
            one.matrix[row][row] += 2.0 * SIZE;
            one.right[row] = numbers.between(-3.0, 3.0);
        }
}

double kernel() {
    double total = 0.0;
    for (const Problem& one : problems) {
        double lower[SIZE][SIZE], diagonal[SIZE], found[SIZE];
        for (int row = 0; row < SIZE; ++row) {
            for (int column = 0; column < row; ++column) {
                double sum = one.matrix[row][column];
                for (int k = 0; k < column; ++k)
                    sum -= lower[row][k] * diagonal[k] * lower[column][k];
                lower[row][column] = sum / diagonal[column];
            }
            double sum = one.matrix[row][row];
            for (int k = 0; k < row; ++k)
                sum -= lower[row][k] * lower[row][k] * diagonal[k];
            diagonal[row] = sum;
        }
        for (int row = 0; row < SIZE; ++row) {
            found[row] = one.right[row];
            for (int k = 0; k < row; ++k)
                found[row] -= lower[row][k] * found[k];
        }
        for (int row = SIZE - 1; row >= 0; --row) {
            found[row] /= diagonal[row];
            for (int k = row + 1; k < SIZE; ++k)
                found[row] -= lower[k][row] * found[k];
        }
        total += found[0] + found[SIZE - 1];
    }
    return total;
}
