// Notch and low-pass filters of gyroscope samples in fixed point, with saturation, for three axes.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct Section {
    std::int32_t b[3], a[2];
    std::int64_t x[2], y[2];
};
std::vector<std::int16_t> samples;
Section sections[3][4];

std::int32_t saturated(std::int64_t value) {
    return static_cast<std::int32_t>(value > 32767 ? 32767 : value < -32768 ? -32768 : value);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    samples.resize(3 * of(input, 500, 900, 700, 800));
    int loud = of(input, 9000, 30000, 4000, 32000);
    for (std::int16_t& one : samples)
        one = static_cast<std::int16_t>(static_cast<int>(numbers.below(2 * loud)) - loud);
    for (auto& axis : sections)
        for (Section& one : axis) {
            int base = 4000 + static_cast<int>(numbers.below(3000));
            one = {{base, 2 * base, base}, {-9000, 3500}, {0, 0}, {0, 0}};
        }
}

double kernel() {
    std::int64_t energy = 0;
    int clipped = 0;
    for (auto& axis : sections)
        for (Section& one : axis)
            one.x[0] = one.x[1] = one.y[0] = one.y[1] = 0;
    for (std::size_t at = 0; at < samples.size(); at += 3)
        for (int axis = 0; axis < 3; ++axis) {
            std::int64_t value = samples[at + axis];
            for (Section& one : sections[axis]) {
                std::int64_t sum = one.b[0] * value + one.b[1] * one.x[0] + one.b[2] * one.x[1] -
                                   one.a[0] * one.y[0] - one.a[1] * one.y[1];
                std::int32_t next = saturated(sum >> 14);
                clipped += next == 32767 || next == -32768;
                one.x[1] = one.x[0], one.x[0] = value;
                one.y[1] = one.y[0], one.y[0] = next;
                value = next;
            }
            energy += value * value >> 8;
        }
    return static_cast<double>(energy) + clipped;
}
