// Speeds of a drone are tried against the cones of moving obstacles; the cheapest that is free is taken.
#include <cmath>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Obstacle {
    float x, y, vx, vy, radius;
};
std::vector<Obstacle> obstacles;
int directions, speeds;
float wish_x, wish_y;

float time_to_hit(const Obstacle& one, float vx, float vy) {
    float rx = one.vx - vx, ry = one.vy - vy;
    float a = rx * rx + ry * ry, b = one.x * rx + one.y * ry;
    float c = one.x * one.x + one.y * one.y - one.radius * one.radius;
    if (c < 0)
        return 0;
    float inside = b * b - a * c;
    if (b >= 0 || inside < 0)
        return 1e9f;
    return c / (std::sqrt(inside) - b);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    obstacles.resize(of(input, 10, 18, 14, 16));
    directions = of(input, 24, 36, 30, 32);
    speeds = of(input, 4, 5, 6, 5);
    for (Obstacle& one : obstacles)
        one = {static_cast<float>(numbers.between(-30, 30)), static_cast<float>(numbers.between(-30, 30)),
               static_cast<float>(numbers.between(-4, 4)), static_cast<float>(numbers.between(-4, 4)),
               static_cast<float>(numbers.between(1, 3))};
    wish_x = static_cast<float>(numbers.between(-5, 5));
    wish_y = static_cast<float>(numbers.between(-5, 5));
}

double kernel() {
    double cheapest = 1e18, at = 0;
    for (int d = 0; d < directions; ++d) {
        float x = std::cos(6.2831853f * d / directions), y = std::sin(6.2831853f * d / directions);
        for (int s = 1; s <= speeds; ++s) {
            float vx = x * s * 1.5f, vy = y * s * 1.5f, soonest = 1e9f;
            for (const Obstacle& one : obstacles) {
                float time = time_to_hit(one, vx, vy);
                if (time < soonest)
                    soonest = time;
                if (soonest < 0.5f)
                    break;
            }
            if (soonest < 0.5f)
                continue;
            double cost = std::hypot(vx - wish_x, vy - wish_y) + 8.0 / soonest;
            if (cost < cheapest)
                cheapest = cost, at = d * 10 + s;
        }
    }
    return cheapest + at;
}
