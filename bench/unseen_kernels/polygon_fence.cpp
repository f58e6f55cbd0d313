// Positions of a swarm against a geofence of several polygons: ray casting, and the distance to the nearest edge.
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Point {
    double x, y;
};
std::vector<std::vector<Point>> fences;
std::vector<Point> positions;

bool inside(const std::vector<Point>& fence, Point at) {
    bool within = false;
    for (std::size_t i = 0, before = fence.size() - 1; i < fence.size(); before = i++) {
        const Point &a = fence[i], &b = fence[before];
        if ((a.y > at.y) != (b.y > at.y) && at.x < (b.x - a.x) * (at.y - a.y) / (b.y - a.y) + a.x)
            within = !within;
    }
    return within;
}

double nearest(const std::vector<Point>& fence, Point at) {
    double least = 1e18;
    for (std::size_t i = 0, before = fence.size() - 1; i < fence.size(); before = i++) {
        double dx = fence[i].x - fence[before].x, dy = fence[i].y - fence[before].y;
        double px = at.x - fence[before].x, py = at.y - fence[before].y;
        double along = (px * dx + py * dy) / (dx * dx + dy * dy);
        along = along < 0.0 ? 0.0 : along > 1.0 ? 1.0 : along;
        double ex = px - along * dx, ey = py - along * dy, square = ex * ex + ey * ey;
        if (square < least)
            least = square;
    }
    return std::sqrt(least);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    fences.resize(of(input, 3, 5, 4, 6));
    int corners = of(input, 9, 14, 11, 17);
    for (std::size_t number = 0; number < fences.size(); ++number) {
        fences[number].resize(corners + 2 * number);
        for (std::size_t i = 0; i < fences[number].size(); ++i) {
            double angle = 6.283185 * i / fences[number].size(), radius = numbers.between(40, 160);
            fences[number][i] = {100.0 * number + radius * std::cos(angle), radius * std::sin(angle)};
        }
    }
    positions.resize(of(input, 60, 90, 75, 110));
    for (Point& one : positions)
        one = {numbers.between(-150, 550), numbers.between(-150, 150)};
}

double kernel() {
    double sum = 0.0;
    for (const Point& at : positions)
        for (const auto& fence : fences)
            if (inside(fence, at))
                sum += nearest(fence, at);
    return sum;
}
