// Frontiers of an explored map in bits: neighbours by shifts, cells one by one by their lowest set bit.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
int words, rows;
std::vector<std::uint64_t> free_cells, unknown, frontier;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    words = of(input, 3, 5, 4, 6), rows = of(input, 70, 110, 90, 130);
    int dense = of(input, 5, 9, 7, 12);
    free_cells.assign(words * rows, 0), unknown.assign(words * rows, 0), frontier.assign(words * rows, 0);
    for (int i = 0; i < words * rows; ++i)
        for (int bit = 0; bit < 64; ++bit) {
            bool explored = (i / words - rows / 2) * (i / words - rows / 2) + (bit - 32) * (bit - 32) < 900;
            if (explored && numbers.below(dense) != 0)
                free_cells[i] |= 1ull << bit;
            else if (!explored || numbers.below(20) == 0)
                unknown[i] |= 1ull << bit;
        }
}

double kernel() {
    double score = 0.0;
    for (int y = 1; y < rows - 1; ++y)
        for (int x = 0; x < words; ++x) {
            int at = y * words + x;
            std::uint64_t own = unknown[at];
            std::uint64_t left = own << 1 | (x > 0 ? unknown[at - 1] >> 63 : 0);
            std::uint64_t right = own >> 1 | (x + 1 < words ? unknown[at + 1] << 63 : 0);
            frontier[at] = free_cells[at] & (left | right | unknown[at - words] | unknown[at + words]);
        }
    for (int y = 1; y < rows - 1; ++y)
        for (int x = 0; x < words; ++x)
            for (std::uint64_t left = frontier[y * words + x]; left != 0; left &= left - 1) {
                int column = 64 * x + __builtin_ctzll(left);
                int dx = column - 32 * words, dy = y - rows / 2;
                int around = __builtin_popcountll(frontier[y * words + x] & frontier[(y - 1) * words + x]);
                score += around * 0.5 - (dx * dx + dy * dy) * 0.001;
            }
    return score;
}
