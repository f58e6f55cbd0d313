// Regions of one colour in a picture: labels joined by union and find, then area and box of each.
#include <algorithm>
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
int width, height;
std::vector<std::uint8_t> picture;
std::vector<int> label, parent;
struct Region {
    int area, left, right, top, bottom;
    long across, down;
};
std::vector<Region> regions;

int root(int one) {
    while (parent[one] != one) {
        parent[one] = parent[parent[one]];
        one = parent[one];
    }
    return one;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 96, 120, 80, 110);
    height = of(input, 60, 50, 72, 64);
    picture.assign(width * height, 0);
    int blobs = of(input, 40, 25, 60, 50);
    for (; blobs > 0; --blobs) {
        int x = numbers.below(width), y = numbers.below(height);
        int r = 1 + numbers.below(6), colour = numbers.below(4);
        for (int v = std::max(0, y - r); v < std::min(height, y + r); ++v)
            for (int u = std::max(0, x - r); u < std::min(width, x + r); ++u)
                if ((u - x) * (u - x) + (v - y) * (v - y) <= r * r)
                    picture[v * width + u] = static_cast<std::uint8_t>(colour);
    }
    for (int specks = width * height / of(input, 30, 15, 50, 20); specks > 0; --specks)
        picture[numbers.below(width * height)] = static_cast<std::uint8_t>(numbers.below(4));
    label.assign(width * height, 0);
    parent.assign(width * height, 0);
    regions.assign(width * height, Region{});
}

double kernel() {
    int labels = 0;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            int at = y * width + x;
            int west = x > 0 && picture[at - 1] == picture[at] ? label[at - 1] : -1;
            int north = y > 0 && picture[at - width] == picture[at] ? label[at - width] : -1;
            if (west < 0 && north < 0) {
                parent[labels] = labels;
                label[at] = labels++;
            } else if (west >= 0 && north >= 0) {
                int a = root(west), b = root(north);
                if (a < b)
                    parent[b] = a;
                else
                    parent[a] = b;
                label[at] = std::min(a, b);
            } else {
                label[at] = west >= 0 ? west : north;
            }
        }
    for (int i = 0; i < labels; ++i)
        regions[i] = {0, width, 0, height, 0, 0, 0};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            Region& one = regions[root(label[y * width + x])];
            ++one.area;
            one.left = std::min(one.left, x);
            one.right = std::max(one.right, x);
            one.top = std::min(one.top, y);
            one.bottom = std::max(one.bottom, y);
            one.across += x;
            one.down += y;
        }
    double sum = 0;
    for (int i = 0; i < labels; ++i)
        if (regions[i].area > 4)
            sum += (regions[i].across * 1.0 / regions[i].area) - regions[i].left + regions[i].bottom;
    return sum + labels;
}
