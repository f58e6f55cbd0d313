// Telemetry in prefix codes: built from frequencies, a stream of bits written, and read bit by bit.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
constexpr int SYMBOLS = 48;
std::vector<std::uint8_t> samples;
std::vector<std::uint8_t> packed;
struct Node {
    int weight, left, right;
};
Node nodes[2 * SYMBOLS];
std::uint32_t codes[SYMBOLS];
int lengths[SYMBOLS];

void walk(int node, std::uint32_t code, int length) {
    if (nodes[node].left < 0) {
        codes[node] = code;
        lengths[node] = length;
        return;
    }
    walk(nodes[node].left, code << 1, length + 1);
    walk(nodes[node].right, code << 1 | 1, length + 1);
}

int build() {
    bool open[2 * SYMBOLS] = {};
    for (int i = 0; i < SYMBOLS; ++i) {
        nodes[i] = {1, -1, -1};
        open[i] = true;
    }
    for (std::uint8_t one : samples)
        ++nodes[one].weight;
    int count = SYMBOLS;
    for (int joins = SYMBOLS - 1; joins > 0; --joins) {
        int least = -1, second = -1;
        for (int i = 0; i < count; ++i) {
            if (!open[i])
                continue;
            if (least < 0 || nodes[i].weight < nodes[least].weight) {
                second = least;
                least = i;
            } else if (second < 0 || nodes[i].weight < nodes[second].weight) {
                second = i;
            }
        }
        open[least] = open[second] = false;
        nodes[count] = {nodes[least].weight + nodes[second].weight, least, second};
        open[count++] = true;
    }
    return count - 1;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    samples.resize(of(input, 2000, 3000, 2400, 3500));
    int wide = of(input, 12, 20, 8, 16), value = SYMBOLS / 2;
    for (std::uint8_t& one : samples) {
        value += numbers.below(wide) - wide / 2 + numbers.below(2);
        value = value < 0 ? 0 : value >= SYMBOLS ? SYMBOLS - 1 : value;
        one = static_cast<std::uint8_t>(value);
    }
    packed.resize(samples.size() * 4 + 8);
}

double kernel() {
    int root = build();
    walk(root, 0, 0);
    std::uint64_t held = 0;
    int bits = 0;
    std::size_t at = 0;
    for (std::uint8_t one : samples) {
        held = held << lengths[one] | codes[one];
        bits += lengths[one];
        while (bits >= 8) {
            bits -= 8;
            packed[at++] = static_cast<std::uint8_t>(held >> bits);
        }
    }
    packed[at++] = static_cast<std::uint8_t>(held << (8 - bits));
    std::size_t read = 0;
    double sum = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
        int node = root;
        while (nodes[node].left >= 0) {
            int bit = packed[read / 8] >> (7 - read % 8) & 1;
            node = bit ? nodes[node].right : nodes[node].left;
            ++read;
        }
        sum += node;
    }
    return sum + at;
}
