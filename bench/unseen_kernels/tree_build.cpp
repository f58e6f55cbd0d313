// A k-d tree over the points of a lidar is built by medians of partitions.
#include <algorithm>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Point {
    float at[3];
};
std::vector<Point> cloud, work;
std::vector<int> axes;

void build(int first, int last, int depth) {
    if (last - first < 4) {
        axes.push_back(-depth);
        return;
    }
    float low[3] = {1e9f, 1e9f, 1e9f}, high[3] = {-1e9f, -1e9f, -1e9f};
    for (int i = first; i < last; ++i)
        for (int axis = 0; axis < 3; ++axis) {
            low[axis] = std::min(low[axis], work[i].at[axis]);
            high[axis] = std::max(high[axis], work[i].at[axis]);
        }
    int axis = 0;
    for (int one = 1; one < 3; ++one)
        if (high[one] - low[one] > high[axis] - low[axis])
            axis = one;
    int left = first, right = last - 1, middle = (first + last) / 2;
    while (left < right) {
        float pivot = work[(left + right) / 2].at[axis];
        int i = left, j = right;
        while (i <= j) {
            while (work[i].at[axis] < pivot)
                ++i;
            while (work[j].at[axis] > pivot)
                --j;
            if (i <= j)
                std::swap(work[i++], work[j--]);
        }
        if (middle <= j)
            right = j;
        else if (middle >= i)
            left = i;
        else
            break;
    }
    axes.push_back(axis);
    build(first, middle, depth + 1);
    build(middle + 1, last, depth + 1);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    cloud.resize(of(input, 300, 520, 410, 640));
    double flat = of(input, 0.2, 1.0, 0.5, 0.1);
    for (Point& one : cloud)
        one = {{static_cast<float>(numbers.between(-20, 20)), static_cast<float>(numbers.between(-12, 30)),
                static_cast<float>(numbers.between(-4, 4) * flat)}};
    axes.reserve(2 * cloud.size());
}

double kernel() {
    work = cloud;
    axes.clear();
    build(0, static_cast<int>(work.size()), 0);
    double sum = 0.0;
    for (int one : axes)
        sum += one;
    return sum + work[work.size() / 3].at[0];
}
