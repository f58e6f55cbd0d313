// Enters a scan into an occupancy grid: free along each ray (Bresenham), occupied where it ends.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "kernel.hpp"

namespace {

constexpr int WIDTH = 128;
std::vector<std::int8_t> grid;
std::vector<int> ends;

void adjust(int x, int y, int by) {
    std::int8_t& cell = grid[y * WIDTH + x];
    cell = static_cast<std::int8_t>(std::clamp(cell + by, -100, 100));
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    grid.assign(WIDTH * WIDTH, 0);
    ends.clear();
    int rays = of(input, 360, 540, 720, 450);
    double far = of(input, 40.0, 62.0, 30.0, 50.0);
    for (int ray = 0; ray < rays; ++ray) {
        double angle = ray * 2.0 * M_PI / rays, away = numbers.between(5.0, far);
        ends.push_back(WIDTH / 2 + static_cast<int>(away * std::cos(angle)));
        ends.push_back(WIDTH / 2 + static_cast<int>(away * std::sin(angle)));
    }
}

double kernel() {
    std::fill(grid.begin(), grid.end(), 0);
    for (std::size_t i = 0; i < ends.size(); i += 2) {
        int x = WIDTH / 2, y = WIDTH / 2, dx = std::abs(ends[i] - x), dy = -std::abs(ends[i + 1] - y);
        int sx = x < ends[i] ? 1 : -1, sy = y < ends[i + 1] ? 1 : -1, error = dx + dy;
        while (x != ends[i] || y != ends[i + 1]) {
            adjust(x, y, -2);
            int twice = 2 * error;
            if (twice >= dy) {
                error += dy;
                x += sx;
            }
            if (twice <= dx) {
                error += dx;
                y += sy;
            }
        }
        adjust(x, y, 9);
    }
    long total = 0;
    for (std::int8_t cell : grid)
        total += cell;
    return static_cast<double>(total);
}
