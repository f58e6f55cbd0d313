// Soft bits of a telemetry radio through Viterbi's decoder of a code of rate 1/2 with sixteen states.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
constexpr int STATES = 16;
std::vector<std::int8_t> soft;
std::vector<std::uint16_t> choices;
int expected[STATES][2][2];

int parity(int value) {
    value ^= value >> 4;
    value ^= value >> 2;
    return (value ^ value >> 1) & 1;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    int bits = of(input, 200, 360, 280, 420), noise = of(input, 30, 70, 50, 90), state = 0;
    soft.clear();
    for (int s = 0; s < STATES; ++s)
        for (int bit = 0; bit < 2; ++bit) {
            int word = bit << 4 | s;
            expected[s][bit][0] = parity(word & 0x13) ? 1 : -1;
            expected[s][bit][1] = parity(word & 0x1d) ? 1 : -1;
        }
    for (int i = 0; i < bits; ++i) {
        int bit = numbers.below(2);
        for (int part = 0; part < 2; ++part) {
            int sent = 30 * expected[state][bit][part];
            soft.push_back(static_cast<std::int8_t>(sent + numbers.below(noise) - noise / 2));
        }
        state = (bit << 4 | state) >> 1;
    }
    choices.resize(bits);
}

double kernel() {
    int metric[STATES], next[STATES];
    for (int s = 0; s < STATES; ++s)
        metric[s] = s == 0 ? 0 : -10000;
    int bits = static_cast<int>(choices.size());
    for (int i = 0; i < bits; ++i) {
        unsigned taken = 0;
        for (int s = 0; s < STATES; ++s) {
            int bit = s >> 3, first = (s << 1) & (STATES - 1), second = first | 1;
            int a = metric[first] + soft[2 * i] * expected[first][bit][0] +
                    soft[2 * i + 1] * expected[first][bit][1];
            int b = metric[second] + soft[2 * i] * expected[second][bit][0] +
                    soft[2 * i + 1] * expected[second][bit][1];
            next[s] = a >= b ? a : b;
            taken |= (a < b ? 1u : 0u) << s;
        }
        choices[i] = static_cast<std::uint16_t>(taken);
        for (int s = 0; s < STATES; ++s)
            metric[s] = next[s];
    }
    int state = 0, sum = 0;
    for (int s = 1; s < STATES; ++s)
        if (metric[s] > metric[state])
            state = s;
    for (int i = bits - 1; i >= 0; --i) {
        int bit = state >> 3;
        sum = (sum * 2 + bit) % 1000003;
        state = ((state << 1) & (STATES - 1)) | ((choices[i] >> state) & 1);
    }
    return sum;
}
