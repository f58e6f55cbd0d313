// One step of iterative closest point: nearest neighbours of a scan in a map, then the best rigid motion.
#include <cmath>
#include <vector>

#include "kernel.hpp"

namespace {

struct Point {
    float x, y;
};

std::vector<Point> map, scan;
int rounds;

Point nearest(const Point& point, float& distance) {
    distance = 1e9f;
    Point best{};
    for (const Point& other : map) {
        float dx = other.x - point.x, dy = other.y - point.y, squared = dx * dx + dy * dy;
        if (squared < distance) {
            distance = squared;
            best = other;
        }
    }
    return best;
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    map.clear();
    scan.clear();
    int size = of(input, 180, 260, 220, 300);
    rounds = of(input, 3, 4, 5, 2);
    for (int i = 0; i < size; ++i) {
        double angle = i * 2.0 * M_PI / size, away = 4.0 + numbers.between(0.0, 2.0);
        map.push_back({static_cast<float>(away * std::cos(angle)), static_cast<float>(away * std::sin(angle))});
    }
    for (int i = 0; i < size; i += 2)
        scan.push_back({map[i].x * 0.998f - map[i].y * 0.05f + 0.1f, map[i].x * 0.05f + map[i].y * 0.998f - 0.05f});
}

double kernel() {
    double x = 0.0, y = 0.0, turn = 0.0;
    for (int round = 0; round < rounds; ++round) {
        double c = std::cos(turn), s = std::sin(turn);
        double ax = 0, ay = 0, bx = 0, by = 0, dot = 0, det = 0;
        int used = 0;
        for (const Point& seen : scan) {
            Point moved{static_cast<float>(c * seen.x - s * seen.y + x), static_cast<float>(s * seen.x + c * seen.y + y)};
            float distance;
            Point match = nearest(moved, distance);
            if (distance > 0.25f)
                continue;
            ++used;
            ax += moved.x;
            ay += moved.y;
            bx += match.x;
            by += match.y;
            dot += moved.x * match.x + moved.y * match.y;
            det += moved.x * match.y - moved.y * match.x;
        }
        if (used == 0)
            break;
        double change = std::atan2(det - (ax * by - ay * bx) / used, dot - (ax * bx + ay * by) / used);
        x += (bx - ax) / used;
        y += (by - ay) / used;
        turn += change;
    }
    return x + y + turn;
}
