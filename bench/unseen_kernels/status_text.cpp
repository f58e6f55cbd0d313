// Lines of status for a ground station: numbers become text with a fixed number of decimals, with a checksum.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
struct State {
    std::int32_t latitude, longitude, altitude;
    std::uint16_t volts, heading;
    std::uint8_t mode;
};
std::vector<State> states;
char line[160];
const char* const MODES[] = {"STABILIZE", "GUIDED", "AUTO", "RTL", "LAND"};

char* number(char* out, std::int64_t value, int decimals) {
    if (value < 0)
        *out++ = '-', value = -value;
    char digits[24];
    int count = 0;
    do
        digits[count++] = static_cast<char>('0' + value % 10), value /= 10;
    while (value != 0 || count <= decimals);
    while (count > 0) {
        if (count == decimals)
            *out++ = '.';
        *out++ = digits[--count];
    }
    return out;
}

char* word(char* out, const char* text) {
    while (*text != 0)
        *out++ = *text++;
    return out;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    states.resize(of(input, 60, 110, 80, 130));
    int far = of(input, 900000000, 90000, 9000000, 1700000000);
    for (State& one : states)
        one = {numbers.below(far) - far / 2,
               -numbers.below(far),
               numbers.below(200000) - 1000,
               static_cast<std::uint16_t>(numbers.below(25000)),
               static_cast<std::uint16_t>(numbers.below(360)),
               static_cast<std::uint8_t>(numbers.below(5))};
}

double kernel() {
    std::uint32_t sum = 0;
    for (const State& one : states) {
        char* out = word(line, "$POS,");
        out = number(out, one.latitude, 7);
        *out++ = ',';
        out = number(out, one.longitude, 7);
        *out++ = ',';
        out = number(out, one.altitude, 3);
        *out++ = ',';
        out = number(out, one.volts, 2);
        *out++ = ',';
        out = number(out, one.heading, 0);
        *out++ = ',';
        out = word(out, MODES[one.mode]);
        std::uint8_t check = 0;
        for (char* at = line + 1; at < out; ++at)
            check ^= static_cast<std::uint8_t>(*at);
        *out++ = '*';
        *out++ = "0123456789ABCDEF"[check >> 4];
        *out++ = "0123456789ABCDEF"[check & 15];
        sum += check + static_cast<std::uint32_t>(out - line);
    }
    return sum;
}
