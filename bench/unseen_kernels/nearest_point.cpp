// Nearest neighbours in a k-d tree in an array, as in the alignment of two scans.
#include <algorithm>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Point {
    float at[3];
};
std::vector<Point> tree, asked;

void order(int first, int last, int axis) {
    if (last - first < 2)
        return;
    int middle = (first + last) / 2;
    std::nth_element(tree.begin() + first, tree.begin() + middle, tree.begin() + last,
                     [axis](const Point& a, const Point& b) { return a.at[axis] < b.at[axis]; });
    order(first, middle, (axis + 1) % 3);
    order(middle + 1, last, (axis + 1) % 3);
}
void search(const Point& wanted, int first, int last, int axis, float& best) {
    if (first >= last)
        return;
    int middle = (first + last) / 2;
    const Point& here = tree[middle];
    float away = 0.0f;
    for (int i = 0; i < 3; ++i)
        away += (here.at[i] - wanted.at[i]) * (here.at[i] - wanted.at[i]);
    best = std::min(best, away);
    float across = wanted.at[axis] - here.at[axis];
    int next = axis == 2 ? 0 : axis + 1;
    if (across < 0.0f) {
        search(wanted, first, middle, next, best);
        if (across * across < best)
            search(wanted, middle + 1, last, next, best);
    } else {
        search(wanted, middle + 1, last, next, best);
        if (across * across < best)
            search(wanted, first, middle, next, best);
    }
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    tree.resize(of(input, 2000, 4000, 3000, 5000));
    asked.resize(of(input, 150, 120, 200, 180));
    for (std::vector<Point>* some : {&tree, &asked})
        for (Point& one : *some)
            for (float& value : one.at)
                value = static_cast<float>(numbers.between(-10.0, 10.0));
    order(0, static_cast<int>(tree.size()), 0);
}

double kernel() {
    double total = 0.0;
    for (const Point& one : asked) {
        float best = 1e9f;
        search(one, 0, static_cast<int>(tree.size()), 0, best);
        total += best;
    }
    return total;
}
