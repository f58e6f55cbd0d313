// A radio's receiver: frames with escapes and a CRC by table, byte for byte through a machine of states; bits unpacked.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<std::uint8_t> stream;
std::uint16_t table[256];
enum State { IDLE, LENGTH, BODY, ESCAPED, CHECK_LOW, CHECK_HIGH };

std::uint16_t step(std::uint16_t crc, std::uint8_t byte) {
    return static_cast<std::uint16_t>((crc >> 8) ^ table[(crc ^ byte) & 0xff]);
}
}  // namespace

void prepare(int input) {
    for (int i = 0; i < 256; ++i) {
        std::uint16_t crc = static_cast<std::uint16_t>(i);
        for (int bit = 0; bit < 8; ++bit)
            crc = static_cast<std::uint16_t>(crc & 1 ? (crc >> 1) ^ 0x8408 : crc >> 1);
        table[i] = crc;
    }
    Numbers numbers(input);
    stream.clear();
    int frames = of(input, 150, 250, 200, 300), longest = of(input, 30, 60, 20, 45);
    for (int frame = 0; frame < frames; ++frame) {
        for (int noise = numbers.below(8); noise > 0; --noise)
            stream.push_back(static_cast<std::uint8_t>(numbers.below(0x7e)));
        stream.push_back(0x7e);
        int length = 4 + numbers.below(longest);
        stream.push_back(static_cast<std::uint8_t>(length));
        std::uint16_t crc = 0xffff;
        for (int i = 0; i < length; ++i) {
            std::uint8_t byte = static_cast<std::uint8_t>(numbers.below(256));
            crc = step(crc, byte);
            if (byte == 0x7e || byte == 0x7d) {
                stream.push_back(0x7d);
                byte ^= 0x20;
            }
            stream.push_back(byte);
        }
        if (numbers.below(12) == 0)
            crc ^= 1;
        stream.push_back(static_cast<std::uint8_t>(crc & 0xff));
        stream.push_back(static_cast<std::uint8_t>(crc >> 8));
    }
}

double kernel() {
    State state = IDLE;
    std::uint8_t body[80];
    int length = 0, filled = 0, good = 0, bad = 0;
    std::uint16_t crc = 0, low = 0;
    std::uint32_t sum = 0;
    for (std::uint8_t byte : stream) {
        switch (state) {
            case IDLE:
                if (byte == 0x7e)
                    state = LENGTH;
                break;
            case LENGTH:
                length = byte;
                filled = 0;
                crc = 0xffff;
                state = length > 0 && length <= 80 ? BODY : IDLE;
                break;
            case ESCAPED:
            case BODY:
                if (state == BODY && byte == 0x7d) {
                    state = ESCAPED;
                    break;
                }
                if (state == ESCAPED)
                    byte ^= 0x20;
                body[filled++] = byte;
                crc = step(crc, byte);
                state = filled == length ? CHECK_LOW : BODY;
                break;
            case CHECK_LOW:
                low = byte;
                state = CHECK_HIGH;
                break;
            case CHECK_HIGH:
                if ((low | byte << 8) == crc) {
                    ++good;
                    for (int at = 0, bits = length * 8; at + 11 <= bits; at += 11) {
                        std::uint32_t word = body[at / 8] | body[at / 8 + 1] << 8;
                        if (at / 8 + 2 < length)
                            word |= static_cast<std::uint32_t>(body[at / 8 + 2]) << 16;
                        sum += (word >> (at % 8)) & 0x7ff;
                    }
                } else {
                    ++bad;
                }
                state = IDLE;
                break;
        }
    }
    return good * 1000.0 + bad + sum;
}
