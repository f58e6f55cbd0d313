// A flight log is compressed with a window: repetitions are found through chains of hashes.
#include <cstdint>
#include <cstring>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<std::uint8_t> text, packed;
std::int32_t head[1024], previous[8192];

std::uint32_t hash(const std::uint8_t* at) {
    return ((at[0] << 10 ^ at[1] << 5 ^ at[2]) * 2654435761u) >> 22;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    static const char* const words[] = {"ATT ", "GPS ", "IMU ", "12.5", "0.03", "-7.1", ", ", "\n", "mode", "AUTO"};
    std::size_t length = of(input, 1500, 2600, 2100, 3100);
    int rare = of(input, 6, 11, 9, 4);
    text.clear();
    while (text.size() < length) {
        if (numbers.below(rare) == 0)
            text.push_back(static_cast<std::uint8_t>(numbers.below(256)));
        else
            for (const char* word = words[numbers.below(10)]; *word != 0; ++word)
                text.push_back(static_cast<std::uint8_t>(*word));
    }
    packed.reserve(2 * text.size() + 16);
}

double kernel() {
    std::memset(head, 0xff, sizeof head);
    packed.clear();
    std::size_t at = 0, size = text.size();
    while (at + 3 < size) {
        std::uint32_t place = hash(&text[at]);
        int best = 0, from = 0, tries = 12;
        for (int other = head[place]; other >= 0 && tries-- > 0; other = previous[other]) {
            int length = 0;
            while (at + length < size && length < 66 && text[other + length] == text[at + length])
                ++length;
            if (length > best)
                best = length, from = other;
        }
        int step = best >= 3 ? best : 1;
        if (best >= 3) {
            int back = static_cast<int>(at) - from;
            packed.push_back(static_cast<std::uint8_t>(0x80 | (best - 3)));
            packed.push_back(static_cast<std::uint8_t>(back));
            packed.push_back(static_cast<std::uint8_t>(back >> 8));
        } else {
            packed.push_back(text[at] & 0x7f);
        }
        for (; step > 0 && at + 3 < size; --step, ++at) {
            std::uint32_t own = hash(&text[at]);
            previous[at] = head[own];
            head[own] = static_cast<std::int32_t>(at);
        }
        if (step > 0)
            break;
    }
    return static_cast<double>(packed.size());
}
