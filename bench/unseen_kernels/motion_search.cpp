// Block matching between two pictures of a video: sums of absolute differences along a diamond.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
constexpr int WIDTH = 160, SIDE = 8;
std::vector<std::uint8_t> before, after;
int rows;

int difference(const std::uint8_t* one, const std::uint8_t* other, int limit) {
    int sum = 0;
    for (int y = 0; y < SIDE; ++y) {
        for (int x = 0; x < SIDE; ++x)
            sum += std::abs(one[y * WIDTH + x] - other[y * WIDTH + x]);
        if (sum >= limit)
            return sum;
    }
    return sum;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    rows = of(input, 48, 80, 64, 72);
    int shift = of(input, 2, 5, 3, 4), noise = of(input, 6, 20, 12, 9);
    before.resize(WIDTH * rows);
    after.resize(WIDTH * rows);
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < WIDTH; ++x)
            before[y * WIDTH + x] =
                static_cast<std::uint8_t>(((x * x + 7 * y * x) >> 4) % 200 + numbers.below(noise));
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < WIDTH; ++x)
            after[y * WIDTH + x] = static_cast<std::uint8_t>(before[y * WIDTH + (x + shift) % WIDTH] +
                                                             numbers.below(noise) / 2);
}

double kernel() {
    static const int steps[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    double total = 0;
    for (int top = 8; top + 16 <= rows; top += SIDE)
        for (int left = 8; left + 24 <= WIDTH; left += SIDE) {
            const std::uint8_t* block = &after[top * WIDTH + left];
            int dx = 0, dy = 0, best = difference(block, &before[top * WIDTH + left], 1 << 20);
            for (bool better = true; better;) {
                better = false;
                int from_x = dx, from_y = dy;
                for (const auto& step : steps) {
                    int x = from_x + step[0], y = from_y + step[1];
                    if (x < -8 || x > 8 || y < -8 || y > 8)
                        continue;
                    int found = difference(block, &before[(top + y) * WIDTH + left + x], best);
                    if (found < best) {
                        best = found, dx = x, dy = y;
                        better = true;
                    }
                }
            }
            total += best + dx * 3 + dy;
        }
    return total;
}
