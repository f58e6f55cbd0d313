// Finds frames in a stream of bytes, checks their CRC (X.25) and adds up a field, as a MAVLink 1 parser does.
#include <cstring>
#include <vector>

#include "kernel.hpp"

namespace {

std::vector<std::uint8_t> stream;

std::uint16_t accumulate(std::uint16_t crc, std::uint8_t byte) {
    std::uint8_t mixed = byte ^ static_cast<std::uint8_t>(crc);
    mixed ^= static_cast<std::uint8_t>(mixed << 4);
    return static_cast<std::uint16_t>((crc >> 8) ^ (mixed << 8) ^ (mixed << 3) ^ (mixed >> 4));
}

struct Parser {
    enum State { START, LENGTH, HEAD, BODY, CRC_LOW, CRC_HIGH } state = START;
    std::uint8_t length = 0, got = 0, body[255], low = 0;
    std::uint16_t crc = 0xFFFF;

    bool feed(std::uint8_t byte) {
        switch (state) {
            case START:
                if (byte == 0xFE) {
                    crc = 0xFFFF;
                    state = LENGTH;
                }
                return false;
            case LENGTH:
                length = byte;
                crc = accumulate(crc, byte);
                got = 0;
                state = HEAD;
                return false;
            case HEAD:
                crc = accumulate(crc, byte);
                if (++got == 4) {
                    got = 0;
                    state = length ? BODY : CRC_LOW;
                }
                return false;
            case BODY:
                crc = accumulate(crc, byte);
                body[got++] = byte;
                if (got == length)
                    state = CRC_LOW;
                return false;
            case CRC_LOW:
                low = byte;
                state = CRC_HIGH;
                return false;
            case CRC_HIGH:
                state = START;
                return crc == static_cast<std::uint16_t>(low | byte << 8);
        }
        return false;
    }
};

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    stream.clear();
    int frames = of(input, 500, 700, 600, 900), least = of(input, 12, 4, 8, 6), span = of(input, 30, 60, 90, 45);
    for (int i = 0; i < frames; ++i) {
        for (int noise = numbers.below(of(input, 3, 6, 9, 5)); noise > 0; --noise)
            stream.push_back(static_cast<std::uint8_t>(numbers.below(200)));
        int length = least + numbers.below(span);
        std::uint16_t crc = 0xFFFF;
        stream.push_back(0xFE);
        for (int k = -1; k < 4 + length; ++k) {
            auto byte = static_cast<std::uint8_t>(k < 0 ? length : numbers.below(256));
            stream.push_back(byte);
            crc = accumulate(crc, byte);
        }
        stream.push_back(static_cast<std::uint8_t>(crc));
        stream.push_back(static_cast<std::uint8_t>(crc >> 8));
    }
}

double kernel() {
    Parser parser;
    double total = 0.0;
    int frames = 0;
    for (std::uint8_t byte : stream)
        if (parser.feed(byte)) {
            ++frames;
            std::int32_t value;
            std::memcpy(&value, parser.body, sizeof value);
            total += value * 1e-7;
        }
    return total + frames;
}
