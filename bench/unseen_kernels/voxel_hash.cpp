// Counts points by voxel in an open-addressed table, and visits the fullest neighbours.
#include <cmath>
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Point {
    float x, y, z;
};
struct Voxel {
    std::int64_t key;
    int points;
};
std::vector<Point> points;
std::vector<Voxel> table;

std::int64_t key_of(int x, int y, int z) {
    return (static_cast<std::int64_t>(x & 0x1fffff) << 42) | (static_cast<std::int64_t>(y & 0x1fffff) << 21) |
           (z & 0x1fffff);
}
Voxel& slot_of(std::int64_t key) {
    std::size_t at = (static_cast<std::uint64_t>(key) * 0x9e3779b97f4a7c15ull) >> 40;
    for (at &= table.size() - 1; table[at].key != key && table[at].key != -1; at = (at + 1) & (table.size() - 1)) {
    }
    return table[at];
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    points.resize(of(input, 4000, 6000, 5000, 8000));
    double extent = of(input, 8.0, 20.0, 12.0, 15.0);
    for (Point& one : points)
        one = {static_cast<float>(numbers.between(-extent, extent)), static_cast<float>(numbers.between(-extent, extent)),
               static_cast<float>(numbers.between(0.0, 4.0))};
    table.resize(16384);
}

double kernel() {
    for (Voxel& one : table)
        one = {-1, 0};
    for (const Point& one : points) {
        std::int64_t key = key_of(static_cast<int>(std::floor(one.x * 2.0f)), static_cast<int>(std::floor(one.y * 2.0f)),
                                  static_cast<int>(one.z));
        Voxel& voxel = slot_of(key);
        voxel.key = key;
        ++voxel.points;
    }
    double total = 0.0;
    for (const Voxel& one : table)
        if (one.key != -1 && one.points > 1)
            total += slot_of(one.key + 1).points * 0.5 + one.points;
    return total;
}
