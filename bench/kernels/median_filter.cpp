// Three by three median of a depth image by insertion; missing readings (zero) are left out.
#include <vector>

#include "kernel.hpp"

namespace {

int width, height;
std::vector<std::uint16_t> image, out;

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 64, 96, 80, 72);
    height = of(input, 48, 72, 80, 60);
    image.resize(width * height);
    out.resize(width * height);
    int missing = of(input, 5, 15, 25, 10);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image[y * width + x] = numbers.below(100) < missing
                                       ? 0
                                       : static_cast<std::uint16_t>(1000 + 10 * x + 3 * y + numbers.below(80));
}

double kernel() {
    long total = 0;
    for (int y = 1; y + 1 < height; ++y)
        for (int x = 1; x + 1 < width; ++x) {
            std::uint16_t around[9];
            int count = 0;
            for (int dy = -1; dy <= 1; ++dy)
                for (int dx = -1; dx <= 1; ++dx) {
                    std::uint16_t value = image[(y + dy) * width + x + dx];
                    if (value == 0)
                        continue;
                    int place = count++;
                    while (place > 0 && around[place - 1] > value) {
                        around[place] = around[place - 1];
                        --place;
                    }
                    around[place] = value;
                }
            out[y * width + x] = count ? around[count / 2] : 0;
            total += out[y * width + x];
        }
    return static_cast<double>(total);
}
