// Distances of the free cells of a map to the nearest obstacle: a wave from all obstacles through a ring buffer.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
int width, height;
std::vector<std::uint8_t> obstacles;
std::vector<std::uint16_t> distance;
std::vector<int> ring;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 96, 160, 128, 144);
    height = of(input, 80, 100, 120, 110);
    obstacles.assign(width * height, 0);
    distance.resize(width * height);
    ring.resize(1 << 14);
    for (int i = 0; i < of(input, 120, 60, 200, 150); ++i)
        obstacles[numbers.below(height) * width + numbers.below(width)] = 1;
}

double kernel() {
    unsigned first = 0, last = 0;
    const unsigned mask = static_cast<unsigned>(ring.size()) - 1;
    for (int cell = 0; cell < width * height; ++cell) {
        distance[cell] = obstacles[cell] ? 0 : 0xffff;
        if (obstacles[cell])
            ring[last++ & mask] = cell;
    }
    const int beside[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    while (first != last) {
        int cell = ring[first++ & mask];
        int x = cell % width, y = cell / width;
        for (const auto& one : beside) {
            int nx = x + one[0], ny = y + one[1];
            if (nx < 0 || ny < 0 || nx >= width || ny >= height)
                continue;
            int next = ny * width + nx;
            if (distance[next] != 0xffff)
                continue;
            distance[next] = static_cast<std::uint16_t>(distance[cell] + 1);
            ring[last++ & mask] = next;
        }
    }
    double total = 0.0;
    for (std::uint16_t one : distance)
        total += one;
    return total;
}
