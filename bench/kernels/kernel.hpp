// What every kernel of this folder offers. Written before anything was calibrated on them.
#pragma once
#include <cstdint>

constexpr int CALIBRATING = 0;  // the input on which block costs are taken
constexpr int SEEN = 1;         // other data, another size and mix; was looked at while the model of a core was made
constexpr int SEEN_TOO = 2;     // another one again; led to wrong predictions being charged to the way that was taken
constexpr int JUDGING = 3;      // and one that was written when all that was finished: costs are judged on this

extern "C" void prepare(int input);  // builds the input; not counted
extern "C" double kernel();          // one activation, the same work each time; returns a checksum

template <typename T>
T of(int input, T calibrating, T seen, T seen_too, T judging) {
    return input == CALIBRATING ? calibrating : input == SEEN ? seen : input == SEEN_TOO ? seen_too : judging;
}

// Numbers that look random and are the same everywhere (Numerical Recipes' linear congruence).
struct Numbers {
    std::uint64_t state;
    explicit Numbers(int input) : state(of(input, 12345u, 987654321u, 555000111u, 2024061503u)) {}
    std::uint32_t next() {
        state = state * 6364136223846793005ull + 1442695040888963407ull;
        return static_cast<std::uint32_t>(state >> 33);
    }
    double between(double low, double high) { return low + (high - low) * (next() * (1.0 / 2147483648.0)); }
    int below(int limit) { return static_cast<int>(next() % static_cast<std::uint32_t>(limit)); }
};
