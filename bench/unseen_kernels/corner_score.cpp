// Corners of a grey image: gradients, sums over a window and the Harris score, with a threshold.
#include <cstdint>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<std::uint8_t> image;
std::vector<int> gradients_x, gradients_y;
int width, height;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    width = of(input, 96, 160, 128, 144), height = of(input, 72, 60, 64, 80);
    image.resize(width * height);
    gradients_x.resize(width * height);
    gradients_y.resize(width * height);
    int tile = of(input, 12, 20, 9, 15);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
            image[y * width + x] = static_cast<std::uint8_t>(((x / tile + y / tile) % 2) * 140 + numbers.below(40));
}

double kernel() {
    for (int y = 1; y < height - 1; ++y)
        for (int x = 1; x < width - 1; ++x) {
            int at = y * width + x;
            gradients_x[at] = image[at + 1] - image[at - 1];
            gradients_y[at] = image[at + width] - image[at - width];
        }
    double found = 0.0;
    for (int y = 2; y < height - 2; ++y)
        for (int x = 2; x < width - 2; ++x) {
            int xx = 0, yy = 0, xy = 0;
            for (int j = -1; j <= 1; ++j)
                for (int i = -1; i <= 1; ++i) {
                    int gx = gradients_x[(y + j) * width + x + i], gy = gradients_y[(y + j) * width + x + i];
                    xx += gx * gx, yy += gy * gy, xy += gx * gy;
                }
            double score = static_cast<double>(xx) * yy - static_cast<double>(xy) * xy;
            double trace = xx + yy;
            if (score - 0.05 * trace * trace > 1e8)
                found += x + y * 0.01;
        }
    return found;
}
