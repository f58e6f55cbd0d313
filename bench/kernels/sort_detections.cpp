// Sorts detections by score and keeps those that no better one overlaps.
#include <algorithm>
#include <vector>

#include "kernel.hpp"

namespace {

struct Box {
    float x, y, w, h, score;
    int kind;
};

std::vector<Box> detections;

float overlap(const Box& a, const Box& b) {
    float w = std::min(a.x + a.w, b.x + b.w) - std::max(a.x, b.x);
    float h = std::min(a.y + a.h, b.y + b.h) - std::max(a.y, b.y);
    if (w <= 0.0f || h <= 0.0f)
        return 0.0f;
    float common = w * h;
    return common / (a.w * a.h + b.w * b.h - common);
}

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    detections.clear();
    int field = of(input, 500, 900, 300, 700);
    for (int i = 0; i < of(input, 600, 900, 1200, 800); ++i)
        detections.push_back({static_cast<float>(numbers.between(0, field)), static_cast<float>(numbers.between(0, field)),
                              static_cast<float>(numbers.between(20, 60)), static_cast<float>(numbers.between(20, 60)),
                              static_cast<float>(numbers.between(0, 1)), numbers.below(3)});
}

double kernel() {
    std::vector<Box> sorted = detections, kept;
    std::sort(sorted.begin(), sorted.end(), [](const Box& a, const Box& b) { return a.score > b.score; });
    for (const Box& box : sorted) {
        bool covered = false;
        for (const Box& better : kept)
            if (better.kind == box.kind && overlap(better, box) > 0.3f) {
                covered = true;
                break;
            }
        if (!covered)
            kept.push_back(box);
    }
    double total = 0.0;
    for (const Box& box : kept)
        total += box.score;
    return total + static_cast<double>(kept.size());
}
