// A SHA-256 digest of a log block: rotations, sums and a message schedule of 32 bits.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<std::uint8_t> block;
std::uint32_t constants[64];

std::uint32_t turned(std::uint32_t value, int by) {
    return value >> by | value << (32 - by);
}

void compress(std::uint32_t* state, const std::uint8_t* bytes) {
    std::uint32_t w[64];
    for (int i = 0; i < 16; ++i)
        w[i] = static_cast<std::uint32_t>(bytes[4 * i]) << 24 | bytes[4 * i + 1] << 16 |
               bytes[4 * i + 2] << 8 | bytes[4 * i + 3];
    for (int i = 16; i < 64; ++i) {
        std::uint32_t low = turned(w[i - 15], 7) ^ turned(w[i - 15], 18) ^ w[i - 15] >> 3;
        std::uint32_t high = turned(w[i - 2], 17) ^ turned(w[i - 2], 19) ^ w[i - 2] >> 10;
        w[i] = w[i - 16] + low + w[i - 7] + high;
    }
    std::uint32_t a = state[0], b = state[1], c = state[2], d = state[3];
    std::uint32_t e = state[4], f = state[5], g = state[6], h = state[7];
    for (int i = 0; i < 64; ++i) {
        std::uint32_t mixed = turned(e, 6) ^ turned(e, 11) ^ turned(e, 25);
        std::uint32_t first = h + mixed + ((e & f) ^ (~e & g)) + constants[i] + w[i];
        std::uint32_t then = (turned(a, 2) ^ turned(a, 13) ^ turned(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
        h = g, g = f, f = e, e = d + first;
        d = c, c = b, b = a, a = first + then;
    }
    const std::uint32_t after[8] = {a, b, c, d, e, f, g, h};
    for (int i = 0; i < 8; ++i)
        state[i] += after[i];
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    block.resize(64 * of(input, 24, 40, 32, 50));
    for (std::uint8_t& one : block)
        one = static_cast<std::uint8_t>(numbers.below(256));
    for (std::uint32_t& one : constants)
        one = static_cast<std::uint32_t>(numbers.below(1 << 30)) * 4u + 1u;
}

double kernel() {
    std::uint32_t state[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    for (std::size_t at = 0; at < block.size(); at += 64)
        compress(state, &block[at]);
    return state[0] + state[7];
}
