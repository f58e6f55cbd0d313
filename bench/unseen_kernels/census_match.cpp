// Stereo: the census of two pictures' neighbourhoods as bits, matched by Hamming distance along rows.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
int width, height, range;
std::vector<std::uint8_t> left, right;
std::vector<std::uint32_t> left_census, right_census;

void census(const std::vector<std::uint8_t>& picture, std::vector<std::uint32_t>& out) {
    for (int y = 2; y < height - 2; ++y)
        for (int x = 2; x < width - 2; ++x) {
            std::uint32_t word = 0;
            std::uint8_t centre = picture[y * width + x];
            for (int dy = -2; dy <= 2; ++dy)
                for (int dx = -2; dx <= 2; ++dx)
                    word = word << 1 | (picture[(y + dy) * width + x + dx] < centre);
            out[y * width + x] = word;
        }
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 64, 80, 72, 96);
    height = of(input, 24, 20, 28, 22);
    range = of(input, 12, 16, 10, 14);
    left.assign(width * height, 0);
    right.assign(width * height, 0);
    for (std::uint8_t& one : left)
        one = static_cast<std::uint8_t>(numbers.below(256));
    for (int y = 0; y < height; ++y) {
        int shift = 2 + y * (range - 3) / height;
        for (int x = 0; x < width; ++x)
            right[y * width + x] =
                static_cast<std::uint8_t>((left[y * width + (x + shift) % width] + numbers.below(20)) & 255);
    }
    left_census.assign(width * height, 0);
    right_census.assign(width * height, 0);
}

double kernel() {
    census(left, left_census);
    census(right, right_census);
    double sum = 0;
    int rejected = 0;
    for (int y = 2; y < height - 2; ++y)
        for (int x = 2 + range; x < width - 2; ++x) {
            int best = 99, second = 99, where = 0;
            for (int d = 0; d < range; ++d) {
                int at = y * width + x;
                int distance = __builtin_popcount(left_census[at] ^ right_census[at - d]);
                if (distance < best) {
                    second = best;
                    best = distance;
                    where = d;
                } else if (distance < second) {
                    second = distance;
                }
            }
            if (best + 2 < second)
                sum += where;
            else
                ++rejected;
        }
    return sum + rejected * 0.001;
}
