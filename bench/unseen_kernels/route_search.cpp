// Shortest routes through a road network: Dijkstra with a binary heap over lists of neighbours.
#include <algorithm>
#include <functional>
#include <utility>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Road {
    int to;
    float length;
};
std::vector<int> first;
std::vector<Road> roads;
std::vector<float> distance;
std::vector<std::pair<float, int>> heap;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    int places = of(input, 3000, 5000, 4000, 6000), degree = of(input, 5, 3, 4, 4);
    first.assign(1, 0);
    roads.clear();
    for (int place = 0; place < places; ++place) {
        for (int i = 0; i < degree; ++i) {
            int near = place + numbers.below(200) - 100;
            roads.push_back({std::clamp(near, 0, places - 1), static_cast<float>(numbers.between(1.0, 50.0))});
        }
        first.push_back(static_cast<int>(roads.size()));
    }
    distance.resize(places);
    heap.reserve(roads.size() + 1);
}

double kernel() {
    std::fill(distance.begin(), distance.end(), 1e9f);
    heap.clear();
    heap.push_back({0.0f, 0});
    distance[0] = 0.0f;
    while (!heap.empty()) {
        auto [so_far, place] = heap.front();
        std::pop_heap(heap.begin(), heap.end(), std::greater<>());
        heap.pop_back();
        if (so_far > distance[place])
            continue;
        for (int i = first[place]; i < first[place + 1]; ++i) {
            float longer = so_far + roads[i].length;
            if (longer < distance[roads[i].to]) {
                distance[roads[i].to] = longer;
                heap.push_back({longer, roads[i].to});
                std::push_heap(heap.begin(), heap.end(), std::greater<>());
            }
        }
    }
    double total = 0.0;
    for (float one : distance)
        total += one < 1e8f ? one : 0.0f;
    return total;
}
