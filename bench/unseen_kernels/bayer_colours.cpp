// A raw picture becomes colours: interpolation along the weaker gradient, white balance and clipping.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
int width, height, gain;
std::vector<std::uint8_t> raw, green, colours;

std::uint8_t clipped(int value) {
    return static_cast<std::uint8_t>(value < 0 ? 0 : value > 255 ? 255 : value);
}
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 48, 64, 56, 72), height = of(input, 32, 40, 36, 52);
    gain = of(input, 300, 360, 280, 410);
    raw.resize(width * height), green.resize(width * height), colours.resize(3 * width * height);
    int noise = of(input, 20, 60, 40, 90);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            raw[y * width + x] = clipped(60 + 2 * x + ((y / 8 + x / 8) & 1) * 70 + numbers.below(noise));
}

double kernel() {
    for (int y = 2; y < height - 2; ++y)
        for (int x = 2; x < width - 2; ++x) {
            const std::uint8_t* at = &raw[y * width + x];
            if (((x ^ y) & 1) == 0) {
                green[y * width + x] = *at;
                continue;
            }
            int across = std::abs(at[-1] - at[1]) + std::abs(2 * at[0] - at[-2] - at[2]);
            int down = std::abs(at[-width] - at[width]) + std::abs(2 * at[0] - at[-2 * width] - at[2 * width]);
            if (across < down)
                green[y * width + x] = clipped((at[-1] + at[1]) / 2 + (2 * at[0] - at[-2] - at[2]) / 4);
            else if (down < across)
                green[y * width + x] =
                    clipped((at[-width] + at[width]) / 2 + (2 * at[0] - at[-2 * width] - at[2 * width]) / 4);
            else
                green[y * width + x] = clipped((at[-1] + at[1] + at[-width] + at[width]) / 4);
        }
    unsigned sum = 0;
    for (int y = 3; y < height - 3; ++y)
        for (int x = 3; x < width - 3; ++x) {
            int at = y * width + x, own = raw[at] - green[at];
            int side = (raw[at - 1] - green[at - 1] + raw[at + 1] - green[at + 1]) / 2;
            colours[3 * at] = clipped(((green[at] + own) * gain) >> 8);
            colours[3 * at + 1] = green[at];
            colours[3 * at + 2] = clipped(((green[at] + side) * (600 - gain)) >> 8);
            sum += colours[3 * at] + 3 * colours[3 * at + 2];
        }
    return sum;
}
