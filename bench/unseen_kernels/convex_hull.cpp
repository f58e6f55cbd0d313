// The convex hull of detected points by sorted chains, its area, and its smallest rectangle by turning edges.
#include <algorithm>
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Place {
    double x, y;
};
std::vector<Place> given, sorted, hull;

double turn(const Place& a, const Place& b, const Place& c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    given.resize(of(input, 220, 400, 300, 350));
    bool round = of(input, 0, 1, 1, 0);
    for (Place& one : given) {
        double angle = numbers.between(0, 6.283), far = round ? 40 : numbers.between(0, 40);
        one = {far * std::cos(angle) + numbers.between(-1, 1), 0.6 * far * std::sin(angle)};
    }
    sorted.resize(given.size());
    hull.resize(2 * given.size());
}

double kernel() {
    std::copy(given.begin(), given.end(), sorted.begin());
    std::sort(sorted.begin(), sorted.end(),
              [](const Place& a, const Place& b) { return a.x < b.x || (a.x == b.x && a.y < b.y); });
    int count = static_cast<int>(sorted.size()), size = 0;
    for (int i = 0; i < count; ++i) {
        while (size >= 2 && turn(hull[size - 2], hull[size - 1], sorted[i]) <= 0)
            --size;
        hull[size++] = sorted[i];
    }
    for (int i = count - 2, least = size + 1; i >= 0; --i) {
        while (size >= least && turn(hull[size - 2], hull[size - 1], sorted[i]) <= 0)
            --size;
        hull[size++] = sorted[i];
    }
    double area = 0, smallest = 1e18;
    for (int i = 0; i + 1 < size; ++i) {
        area += 0.5 * (hull[i].x * hull[i + 1].y - hull[i].y * hull[i + 1].x);
        double x = hull[i + 1].x - hull[i].x, y = hull[i + 1].y - hull[i].y;
        double length = std::sqrt(x * x + y * y) + 1e-12;
        double least[2] = {1e18, 1e18}, most[2] = {-1e18, -1e18};
        for (int k = 0; k + 1 < size; ++k) {
            double along[2] = {(hull[k].x * x + hull[k].y * y) / length,
                               (hull[k].y * x - hull[k].x * y) / length};
            for (int axis = 0; axis < 2; ++axis) {
                least[axis] = std::min(least[axis], along[axis]);
                most[axis] = std::max(most[axis], along[axis]);
            }
        }
        smallest = std::min(smallest, (most[0] - least[0]) * (most[1] - least[1]));
    }
    return area + smallest;
}
