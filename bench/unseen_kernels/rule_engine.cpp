// A stack machine that evaluates the rules of a mission: byte code, a switch for each operation, jumps.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
enum Operation : std::uint8_t {
    PUSH, READ, ADD, SUBTRACT, MULTIPLY, LESS, AND, OR, NOT, SKIP_IF_NOT, STORE, END
};
struct Instruction {
    Operation operation;
    std::int16_t argument;
};
std::vector<std::vector<Instruction>> rules;
std::vector<float> first, state;
int ticks;

float evaluate(const std::vector<Instruction>& rule) {
    float stack[16];
    int top = 0;
    for (std::size_t at = 0;; ++at) {
        const Instruction& one = rule[at];
        switch (one.operation) {
            case PUSH: stack[top++] = one.argument * 0.25f; break;
            case READ: stack[top++] = state[one.argument]; break;
            case ADD: --top, stack[top - 1] += stack[top]; break;
            case SUBTRACT: --top, stack[top - 1] -= stack[top]; break;
            case MULTIPLY: --top, stack[top - 1] *= stack[top]; break;
            case LESS: --top, stack[top - 1] = stack[top - 1] < stack[top]; break;
            case AND: --top, stack[top - 1] = stack[top - 1] != 0 && stack[top] != 0; break;
            case OR: --top, stack[top - 1] = stack[top - 1] != 0 || stack[top] != 0; break;
            case NOT: stack[top - 1] = stack[top - 1] == 0; break;
            case SKIP_IF_NOT: at += stack[--top] == 0 ? one.argument : 0; break;
            case STORE: state[one.argument] = stack[--top]; break;
            case END: return top ? stack[top - 1] : 0;
        }
    }
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    int count = of(input, 12, 20, 16, 18);
    ticks = of(input, 60, 50, 40, 70);
    first.assign(32, 0);
    for (float& one : first)
        one = static_cast<float>(numbers.between(-20, 20));
    rules.assign(count, {});
    for (auto& rule : rules) {
        auto place = [&] { return static_cast<std::int16_t>(numbers.below(32)); };
        int terms = 2 + static_cast<int>(numbers.below(4));
        for (int i = 0; i < terms; ++i) {
            rule.push_back({READ, place()});
            rule.push_back({PUSH, static_cast<std::int16_t>(static_cast<int>(numbers.below(80)) - 40)});
            rule.push_back({numbers.below(2) ? LESS : SUBTRACT, 0});
            if (i)
                rule.push_back({numbers.below(2) ? AND : OR, 0});
        }
        if (numbers.below(2))
            rule.push_back({NOT, 0});
        rule.push_back({SKIP_IF_NOT, 5});
        rule.push_back({READ, place()});
        rule.push_back({PUSH, 3});
        rule.push_back({MULTIPLY, 0});
        rule.push_back({PUSH, 1});
        rule.push_back({SUBTRACT, 0});
        rule.push_back({READ, place()});
        rule.push_back({END, 0});
    }
}

double kernel() {
    state = first;
    double sum = 0;
    for (int tick = 0; tick < ticks; ++tick) {
        for (const auto& rule : rules)
            sum += evaluate(rule);
        state[tick % 32] = state[(tick * 7 + 3) % 32] * 0.9f + 0.5f;
    }
    return sum;
}
