// Pure pursuit along a polyline: the nearest segment, a point ahead on it, the curvature to steer.
#include <algorithm>
#include <cmath>
#include <vector>

#include "kernel.hpp"

namespace {

struct Point {
    double x, y;
};

std::vector<Point> path;
int steps;

double along(const Point& a, const Point& b, const Point& p) {
    double dx = b.x - a.x, dy = b.y - a.y;
    return std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
}

Point at(std::size_t segment, double share) {
    const Point &a = path[segment], &b = path[segment + 1];
    return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y)};
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    path = {{0.0, 0.0}};
    double heading = 0.0;
    for (int i = 0; i < of(input, 40, 60, 50, 80); ++i) {
        heading += numbers.between(-0.5, 0.5);
        double length = numbers.between(1.0, of(input, 3.0, 5.0, 8.0, 4.0));
        path.push_back({path.back().x + length * std::cos(heading), path.back().y + length * std::sin(heading)});
    }
    steps = of(input, 600, 900, 700, 1000);
}

double kernel() {
    Point here = path[0];
    double heading = 0.0, crossed = 0.0;
    std::size_t segment = 0;
    for (int step = 0; step < steps; ++step) {
        double least = 1e18, share = 0.0;
        std::size_t last = std::min(segment + 6, path.size() - 1);
        for (std::size_t i = segment; i < last; ++i) {
            double t = along(path[i], path[i + 1], here);
            Point near = at(i, t);
            double away = std::hypot(near.x - here.x, near.y - here.y);
            if (away < least) {
                least = away;
                segment = i;
                share = t;
            }
        }
        double ahead = 1.5, length;
        std::size_t goal = segment;
        while (goal + 2 < path.size() &&
               (length = (1.0 - share) * std::hypot(path[goal + 1].x - path[goal].x, path[goal + 1].y - path[goal].y)) <
                   ahead) {
            ahead -= length;
            share = 0.0;
            ++goal;
        }
        double whole = std::hypot(path[goal + 1].x - path[goal].x, path[goal + 1].y - path[goal].y);
        Point target = at(goal, std::min(share + ahead / whole, 1.0));
        double bearing = std::remainder(std::atan2(target.y - here.y, target.x - here.x) - heading, 2.0 * M_PI);
        heading += std::clamp(2.0 * std::sin(bearing) / 1.5, -1.0, 1.0) * 0.1;
        here.x += 0.1 * std::cos(heading);
        here.y += 0.1 * std::sin(heading);
        crossed += least;
    }
    return crossed + here.x + here.y;
}
