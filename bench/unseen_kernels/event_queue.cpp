// A scheduler: a binary heap of timed events by hand; each event that is taken may schedule others.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Event {
    std::int64_t at;
    int kind;
};
std::vector<Event> first, heap;
int steps;

void push(Event one) {
    heap.push_back(one);
    std::size_t at = heap.size() - 1;
    while (at > 0 && one.at < heap[(at - 1) / 2].at) {
        heap[at] = heap[(at - 1) / 2];
        at = (at - 1) / 2;
    }
    heap[at] = one;
}

Event pop() {
    Event top = heap[0], last = heap.back();
    heap.pop_back();
    std::size_t at = 0, size = heap.size();
    for (std::size_t child = 1; child < size; child = 2 * at + 1) {
        if (child + 1 < size && heap[child + 1].at < heap[child].at)
            ++child;
        if (heap[child].at >= last.at)
            break;
        heap[at] = heap[child];
        at = child;
    }
    if (size)
        heap[at] = last;
    return top;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    first.resize(of(input, 60, 200, 100, 120));
    for (Event& one : first)
        one = {numbers.below(1000000), numbers.below(5)};
    steps = of(input, 2500, 3500, 3000, 4000);
    heap.reserve(4096);
}

double kernel() {
    static const int periods[5] = {1000, 2500, 20000, 33333, 100000};
    heap.clear();
    for (const Event& one : first)
        push(one);
    std::int64_t now = 0, handled[5] = {};
    for (int step = 0; step < steps && !heap.empty(); ++step) {
        Event one = pop();
        now = one.at;
        ++handled[one.kind];
        one.at += periods[one.kind] + (step * 37) % 501;
        push(one);
        if (one.kind == 3 && heap.size() < 1000)
            push({now + 777, step % 3});
    }
    return now + handled[0] * 3.0 + handled[4];
}
