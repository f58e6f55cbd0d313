// Frames of a serial link: escapes bytes, adds a checksum by table, decodes and compares what came back.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<std::uint8_t> payloads, sent;
std::vector<int> lengths;
std::uint16_t table[256];

std::uint16_t checksum(std::uint16_t sum, std::uint8_t byte) {
    return static_cast<std::uint16_t>((sum << 8) ^ table[(sum >> 8) ^ byte]);
}
void put(std::uint8_t byte) {
    if (byte == 0x7e || byte == 0x7d) {
        sent.push_back(0x7d);
        byte ^= 0x20;
    }
    sent.push_back(byte);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    for (int i = 0; i < 256; ++i) {
        std::uint16_t value = static_cast<std::uint16_t>(i << 8);
        for (int bit = 0; bit < 8; ++bit)
            value = static_cast<std::uint16_t>((value << 1) ^ (value & 0x8000 ? 0x1021 : 0));
        table[i] = value;
    }
    lengths.resize(of(input, 80, 150, 100, 120));
    payloads.clear();
    int rare = of(input, 40, 8, 20, 15);
    for (int& length : lengths) {
        length = 8 + numbers.below(of(input, 60, 30, 50, 90));
        for (int i = 0; i < length; ++i)
            payloads.push_back(numbers.below(rare) == 0 ? 0x7e : static_cast<std::uint8_t>(numbers.below(256)));
    }
    sent.reserve(payloads.size() * 2 + lengths.size() * 8);
}

double kernel() {
    sent.clear();
    std::size_t at = 0;
    for (int length : lengths) {
        std::uint16_t sum = 0xffff;
        sent.push_back(0x7e);
        for (int i = 0; i < length; ++i, ++at) {
            sum = checksum(sum, payloads[at]);
            put(payloads[at]);
        }
        put(static_cast<std::uint8_t>(sum >> 8));
        put(static_cast<std::uint8_t>(sum));
    }
    double good = 0.0;
    std::uint16_t sum = 0xffff;
    bool escaped = false;
    for (std::uint8_t byte : sent) {
        if (byte == 0x7e) {
            good += sum == 0 ? 1.0 : 0.0;
            sum = 0xffff;
        } else if (byte == 0x7d) {
            escaped = true;
        } else {
            sum = checksum(sum, escaped ? byte ^ 0x20 : byte);
            escaped = false;
        }
    }
    return good + sent.size();
}
