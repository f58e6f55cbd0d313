// What every kernel of this folder offers. Written before anything was calibrated on them.
#pragma once
#include <cstdint>

constexpr int CALIBRATING = 0;  // the input on which block costs are taken
constexpr int JUDGING = 1;      // the input on which they are judged: other data, another size, another mix

extern "C" void prepare(int input);  // builds the input; not counted
extern "C" double kernel();          // one activation, the same work each time; returns a checksum

// Numbers that look random and are the same everywhere (Numerical Recipes' linear congruence).
struct Numbers {
    std::uint64_t state;
    explicit Numbers(int input) : state(input == JUDGING ? 987654321u : 12345u) {}
    std::uint32_t next() {
        state = state * 6364136223846793005ull + 1442695040888963407ull;
        return static_cast<std::uint32_t>(state >> 33);
    }
    double between(double low, double high) { return low + (high - low) * (next() * (1.0 / 2147483648.0)); }
    int below(int limit) { return static_cast<int>(next() % static_cast<std::uint32_t>(limit)); }
};
