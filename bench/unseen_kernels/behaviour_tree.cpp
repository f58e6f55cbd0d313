// A mission as a behaviour tree: sequences, selectors and leaves by virtual calls, ticked in turn.
#include <memory>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
enum Status { FAILED, RUNNING, DONE };
struct State {
    double battery, height, distance;
    int events;
};
struct Node {
    virtual ~Node() = default;
    virtual Status tick(State& state) = 0;
    virtual void reset() {}
};
struct Sequence : Node {
    std::vector<Node*> children;
    std::size_t next = 0;
    void reset() override { next = 0; }
    Status tick(State& state) override {
        while (next < children.size()) {
            Status status = children[next]->tick(state);
            if (status == RUNNING)
                return RUNNING;
            if (status == FAILED) {
                next = 0;
                return FAILED;
            }
            ++next;
        }
        next = 0;
        return DONE;
    }
};
struct Selector : Node {
    std::vector<Node*> children;
    Status tick(State& state) override {
        for (Node* one : children)
            if (Status status = one->tick(state); status != FAILED)
                return status;
        return FAILED;
    }
};
struct Above : Node {
    double least;
    explicit Above(double limit) : least(limit) {}
    Status tick(State& state) override { return state.battery > least ? DONE : FAILED; }
};
struct Climb : Node {
    double target;
    explicit Climb(double height) : target(height) {}
    Status tick(State& state) override {
        state.height += (target - state.height) * 0.25;
        state.battery -= 0.02;
        double off = state.height - target;
        return off < 0.5 && off > -0.5 ? DONE : RUNNING;
    }
};
struct Approach : Node {
    double speed;
    explicit Approach(double metres) : speed(metres) {}
    Status tick(State& state) override {
        state.distance -= speed;
        state.battery -= 0.01 * speed;
        if (state.distance > 0)
            return RUNNING;
        state.distance += 60;
        return DONE;
    }
};
struct Every : Node {
    int period, left;
    explicit Every(int ticks) : period(ticks), left(ticks) {}
    void reset() override { left = period; }
    Status tick(State& state) override {
        if (--left > 0)
            return FAILED;
        left = period;
        ++state.events;
        return DONE;
    }
};
struct Charge : Node {
    Status tick(State& state) override {
        state.battery += 0.7;
        return state.battery < 100 ? RUNNING : DONE;
    }
};
std::vector<std::unique_ptr<Node>> owned;
std::vector<Node*> roots;
int ticks;

template <typename Kind, typename... Given>
Kind* make(Given... given) {
    owned.push_back(std::make_unique<Kind>(given...));
    return static_cast<Kind*>(owned.back().get());
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    owned.clear();
    roots.clear();
    ticks = of(input, 150, 220, 180, 260);
    for (int vehicles = of(input, 6, 8, 5, 9); vehicles > 0; --vehicles) {
        auto* fly = make<Sequence>();
        fly->children.push_back(make<Above>(20.0 + numbers.below(20)));
        for (int legs = 2 + numbers.below(4); legs > 0; --legs) {
            fly->children.push_back(make<Climb>(numbers.between(5, 60)));
            fly->children.push_back(make<Approach>(numbers.between(2, 15)));
        }
        auto* report = make<Sequence>();
        report->children.push_back(make<Every>(2 + numbers.below(7)));
        report->children.push_back(make<Above>(50.0));
        auto* top = make<Selector>();
        top->children = {report, fly, make<Charge>()};
        roots.push_back(top);
    }
}

double kernel() {
    double sum = 0;
    for (auto& one : owned)
        one->reset();
    std::vector<State> states(roots.size(), State{90, 0, 60, 0});
    for (int tick = 0; tick < ticks; ++tick)
        for (std::size_t i = 0; i < roots.size(); ++i)
            sum += roots[i]->tick(states[i]);
    for (const State& one : states)
        sum += one.battery + one.height + one.events;
    return sum;
}
