// The shortest way over an occupancy grid, eight neighbours, octile heuristic, binary heap.
#include <algorithm>
#include <cstdlib>
#include <queue>
#include <vector>

#include "kernel.hpp"

namespace {

constexpr int STRAIGHT = 10, DIAGONAL = 14;
int width;
std::vector<std::uint8_t> blocked;

struct Open {
    int total, cell;
    bool operator<(const Open& other) const { return total > other.total; }
};

int guess(int cell, int goal) {
    int dx = std::abs(cell % width - goal % width), dy = std::abs(cell / width - goal / width);
    return STRAIGHT * std::max(dx, dy) + (DIAGONAL - STRAIGHT) * std::min(dx, dy);
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 64, 90, 76, 110);
    int percent = of(input, 35, 31, 28, 33);
    blocked.assign(width * width, 0);
    for (int y = 0; y < width; ++y)
        for (int x = 0; x < width; ++x) {
            bool border = x == 0 || y == 0 || x == width - 1 || y == width - 1;
            bool ends = (x < 4 && y < 4) || (x >= width - 4 && y >= width - 4);
            blocked[y * width + x] = border || (!ends && numbers.below(100) < percent);
        }
}

double kernel() {
    const int start = width + 1, goal = width * (width - 1) - 2;
    const int steps[8] = {1, -1, width, -width, width + 1, width - 1, -width + 1, -width - 1};
    std::vector<int> cost(width * width, 1 << 30), from(width * width, -1);
    std::priority_queue<Open> open;
    cost[start] = 0;
    open.push({guess(start, goal), start});
    int expanded = 0;
    while (!open.empty()) {
        Open best = open.top();
        open.pop();
        if (best.cell == goal)
            break;
        if (best.total > cost[best.cell] + guess(best.cell, goal))
            continue;
        ++expanded;
        for (int i = 0; i < 8; ++i) {
            int next = best.cell + steps[i];
            if (blocked[next])
                continue;
            int price = cost[best.cell] + (i < 4 ? STRAIGHT : DIAGONAL);
            if (price < cost[next]) {
                cost[next] = price;
                from[next] = best.cell;
                open.push({price + guess(next, goal), next});
            }
        }
    }
    int length = 0;
    for (int cell = goal; cell >= 0 && cell != start; cell = from[cell])
        ++length;
    return length + expanded * 1e-3;
}
