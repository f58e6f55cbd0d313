// The nearest obstacle in each of 36 sectors of a laser scan: a program that `volery cost` prices on another computer.
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>

constexpr std::size_t kBeams = 720, kSectors = 36;

std::array<float, kSectors> nearest(const std::array<float, kBeams>& ranges) {
    std::array<float, kSectors> found;
    found.fill(INFINITY);
    for (std::size_t beam = 0; beam < kBeams; ++beam) {
        float& sector = found[beam * kSectors / kBeams];
        if (std::isfinite(ranges[beam]) && ranges[beam] < sector) sector = ranges[beam];
    }
    return found;
}

int main() {
    std::array<float, kBeams> ranges;
    for (std::size_t beam = 0; beam < kBeams; ++beam) ranges[beam] = 4.0f + 2.0f * std::sin(0.05f * beam);
    const auto found = nearest(ranges);
    std::printf("%.2f\n", found[9]);
}
