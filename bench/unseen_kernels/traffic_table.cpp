// Air traffic by identifier in a treap by hand: reports insert or renew, old entries are removed.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Aircraft {
    std::uint32_t id, rank;
    int left, right, seen;
    float range;
};
struct Report {
    std::uint32_t id;
    float range;
};
std::vector<Report> reports;
std::vector<Aircraft> pool;
std::vector<int> unused;
int top;
std::uint32_t noise;

int rotate_right(int at) {
    int up = pool[at].left;
    pool[at].left = pool[up].right;
    pool[up].right = at;
    return up;
}

int rotate_left(int at) {
    int up = pool[at].right;
    pool[at].right = pool[up].left;
    pool[up].left = at;
    return up;
}

int put(int at, const Report& one, int now) {
    if (at < 0) {
        int made = unused.back();
        unused.pop_back();
        noise = noise * 1664525u + 1013904223u;
        pool[made] = {one.id, noise >> 8, -1, -1, now, one.range};
        return made;
    }
    if (one.id == pool[at].id) {
        pool[at].seen = now;
        pool[at].range = one.range;
    } else if (one.id < pool[at].id) {
        pool[at].left = put(pool[at].left, one, now);
        if (pool[pool[at].left].rank > pool[at].rank)
            return rotate_right(at);
    } else {
        pool[at].right = put(pool[at].right, one, now);
        if (pool[pool[at].right].rank > pool[at].rank)
            return rotate_left(at);
    }
    return at;
}

int join(int a, int b) {
    if (a < 0 || b < 0)
        return a < 0 ? b : a;
    if (pool[a].rank > pool[b].rank) {
        pool[a].right = join(pool[a].right, b);
        return a;
    }
    pool[b].left = join(a, pool[b].left);
    return b;
}

int sweep(int at, int oldest, float& nearest) {
    if (at < 0)
        return at;
    pool[at].left = sweep(pool[at].left, oldest, nearest);
    pool[at].right = sweep(pool[at].right, oldest, nearest);
    if (pool[at].seen < oldest) {
        unused.push_back(at);
        return join(pool[at].left, pool[at].right);
    }
    nearest = pool[at].range < nearest ? pool[at].range : nearest;
    return at;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    reports.resize(of(input, 1200, 1800, 1500, 2000));
    int aircraft = of(input, 120, 300, 80, 200);
    for (Report& one : reports)
        one = {static_cast<std::uint32_t>(numbers.below(aircraft)) * 2654435761u,
               static_cast<float>(numbers.below(90000))};
    pool.assign(512, Aircraft{});
    unused.reserve(512);
}

double kernel() {
    unused.clear();
    for (int i = 511; i >= 0; --i)
        unused.push_back(i);
    top = -1;
    noise = 1;
    double sum = 0;
    for (int i = 0; i < static_cast<int>(reports.size()); ++i) {
        top = put(top, reports[i], i);
        if (i % 100 == 99) {
            float nearest = 1e9f;
            top = sweep(top, i - 250, nearest);
            sum += nearest;
        }
    }
    return sum + unused.size();
}
