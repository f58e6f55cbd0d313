// A simulated planar lidar: every ray walks the cells of a grid until it meets a wall.
#include <cmath>
#include <vector>

#include "kernel.hpp"

namespace {

constexpr double CELL = 0.1;
int width, rays;
std::vector<std::uint8_t> wall;
std::vector<double> poses;

double range(double x, double y, double angle, double most) {
    double dx = std::cos(angle), dy = std::sin(angle);
    int cx = static_cast<int>(x / CELL), cy = static_cast<int>(y / CELL);
    int sx = dx < 0 ? -1 : 1, sy = dy < 0 ? -1 : 1;
    double per_x = CELL / std::fmax(std::fabs(dx), 1e-9), per_y = CELL / std::fmax(std::fabs(dy), 1e-9);
    double to_x = ((sx > 0 ? cx + 1 : cx) * CELL - x) / (std::fabs(dx) < 1e-9 ? 1e-9 * sx : dx);
    double to_y = ((sy > 0 ? cy + 1 : cy) * CELL - y) / (std::fabs(dy) < 1e-9 ? 1e-9 * sy : dy);
    double gone = 0.0;
    while (gone < most) {
        if (to_x < to_y) {
            gone = to_x;
            to_x += per_x;
            cx += sx;
        } else {
            gone = to_y;
            to_y += per_y;
            cy += sy;
        }
        if (wall[cy * width + cx])
            return gone;
    }
    return most;
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 150, 200, 170, 120);
    rays = of(input, 180, 270, 360, 240);
    wall.assign(width * width, 0);
    for (int i = 0; i < width; ++i)
        wall[i] = wall[(width - 1) * width + i] = wall[i * width] = wall[i * width + width - 1] = 1;
    for (int i = 0; i < of(input, 40, 60, 80, 25); ++i) {
        int x = numbers.below(width - 6), y = numbers.below(width - 6), size = 1 + numbers.below(5);
        for (int k = 0; k < size * size; ++k)
            wall[(y + k / size) * width + x + k % size] = 1;
    }
    poses.clear();
    for (int i = 0; i < 24; ++i)
        poses.push_back(numbers.between(0.2, 0.8) * width * CELL);
}

double kernel() {
    double total = 0.0;
    for (std::size_t i = 0; i + 1 < poses.size(); i += 2)
        for (int ray = 0; ray < rays; ++ray)
            total += range(poses[i], poses[i + 1], ray * (2.0 * M_PI / rays), 12.0);
    return total;
}
