// Decodes a recorded track: numbers of variable length, differences with their sign folded in, a checksum of bits.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<std::uint8_t> bytes;
std::vector<std::int64_t> decoded;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    bytes.clear();
    int wide = of(input, 4, 2, 6, 3), count = of(input, 900, 1500, 1200, 1800);
    for (int i = 0; i < count; ++i) {
        std::int64_t change = numbers.below(wide) == 0 ? numbers.below(2000000) - 1000000 : numbers.below(200) - 100;
        std::uint64_t folded = (static_cast<std::uint64_t>(change) << 1) ^ static_cast<std::uint64_t>(change >> 63);
        for (; folded >= 0x80; folded >>= 7)
            bytes.push_back(static_cast<std::uint8_t>(folded | 0x80));
        bytes.push_back(static_cast<std::uint8_t>(folded));
    }
    decoded.reserve(count);
}

double kernel() {
    decoded.clear();
    std::int64_t value = 0;
    std::uint64_t folded = 0;
    int shift = 0;
    std::uint32_t sum = ~0u;
    for (std::uint8_t one : bytes) {
        sum ^= one;
        for (int bit = 0; bit < 4; ++bit)
            sum = (sum >> 1) ^ (0xedb88320u & (0u - (sum & 1)));
        folded |= static_cast<std::uint64_t>(one & 0x7f) << shift;
        if (one & 0x80) {
            shift += 7;
            continue;
        }
        value += static_cast<std::int64_t>(folded >> 1) ^ -static_cast<std::int64_t>(folded & 1);
        decoded.push_back(value);
        folded = 0;
        shift = 0;
    }
    std::int64_t low = 0, high = 0;
    for (std::int64_t one : decoded) {
        low = one < low ? one : low;
        high = one > high ? one : high;
    }
    return static_cast<double>(high - low) + sum;
}
