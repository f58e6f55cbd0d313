// Reads sentences of a satellite receiver: checks the sum, splits fields, converts numbers without a library.
#include <cstdint>
#include <string>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::string text;

void put_number(Numbers& numbers, int digits, int decimals) {
    for (int i = 0; i < digits; ++i)
        text += static_cast<char>('0' + numbers.below(10));
    text += '.';
    for (int i = 0; i < decimals; ++i)
        text += static_cast<char>('0' + numbers.below(10));
}
int digit_of(char one) { return one >= 'A' ? one - 'A' + 10 : one - '0'; }
double number_of(const char* begin, const char* end) {
    double whole = 0.0, scale = 1.0;
    bool after = false;
    for (; begin < end; ++begin) {
        if (*begin == '.') {
            after = true;
            continue;
        }
        whole = whole * 10.0 + (*begin - '0');
        if (after)
            scale *= 10.0;
    }
    return whole / scale;
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    text.clear();
    for (int i = 0; i < of(input, 60, 120, 90, 150); ++i) {
        std::size_t start = text.size() + 1;
        text += numbers.below(4) == 0 ? "$GPRMC" : "$GNGGA";
        for (int field = 0; field < of(input, 8, 5, 7, 6); ++field) {
            text += ',';
            if (numbers.below(5) == 0)
                text += "NWES"[numbers.below(4)];
            else if (numbers.below(6) != 0)
                put_number(numbers, 1 + numbers.below(5), numbers.below(of(input, 3, 6, 5, 7)));
        }
        std::uint8_t sum = 0;
        for (std::size_t at = start; at < text.size(); ++at)
            sum ^= static_cast<std::uint8_t>(text[at]);
        if (numbers.below(12) == 0)
            sum ^= 4;
        text += '*';
        text += "0123456789ABCDEF"[sum >> 4];
        text += "0123456789ABCDEF"[sum & 15];
        text += "\r\n";
    }
}

double kernel() {
    double total = 0.0;
    const char *at = text.data(), *last = at + text.size();
    const char* fields[24];
    while (at < last) {
        if (*at++ != '$')
            continue;
        const char* begin = at;
        std::uint8_t sum = 0;
        int count = 0;
        for (; at < last && *at != '*'; ++at) {
            sum ^= static_cast<std::uint8_t>(*at);
            if (*at == ',' && count < 24)
                fields[count++] = at + 1;
        }
        if (at + 2 >= last || sum != digit_of(at[1]) * 16 + digit_of(at[2]))
            continue;
        total += begin[3] == 'R' ? 2.0 : 1.0;
        for (int i = 0; i < count; ++i) {
            const char* end = i + 1 < count ? fields[i + 1] - 1 : at;
            if (end > fields[i] && *fields[i] <= '9')
                total += number_of(fields[i], end);
        }
    }
    return total;
}
