// Vibration of a frame: bit reversal and butterflies of a fixed-size transform in place, then the band of most power.
#include <cmath>
#include <utility>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::vector<float> samples, re, im, turn_re, turn_im;
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    int count = of(input, 512, 1024, 256, 2048);
    samples.resize(count);
    re.resize(count);
    im.resize(count);
    turn_re.resize(count / 2);
    turn_im.resize(count / 2);
    double tone = of(input, 0.21, 0.4, 0.1, 0.33);
    for (int i = 0; i < count; ++i)
        samples[i] = static_cast<float>(std::sin(tone * i) + numbers.between(-0.3, 0.3));
    for (int i = 0; i < count / 2; ++i) {
        turn_re[i] = static_cast<float>(std::cos(-6.283185307 * i / count));
        turn_im[i] = static_cast<float>(std::sin(-6.283185307 * i / count));
    }
}

double kernel() {
    int count = static_cast<int>(samples.size());
    for (int i = 0; i < count; ++i) {
        re[i] = samples[i];
        im[i] = 0.0f;
    }
    for (int i = 1, j = 0; i < count; ++i) {
        int bit = count >> 1;
        for (; j & bit; bit >>= 1)
            j ^= bit;
        j ^= bit;
        if (i < j)
            std::swap(re[i], re[j]);
    }
    for (int half = 1; half < count; half <<= 1) {
        int stride = count / (2 * half);
        for (int start = 0; start < count; start += 2 * half)
            for (int k = 0; k < half; ++k) {
                float wr = turn_re[k * stride], wi = turn_im[k * stride];
                int a = start + k, b = a + half;
                float xr = re[b] * wr - im[b] * wi, xi = re[b] * wi + im[b] * wr;
                re[b] = re[a] - xr;
                im[b] = im[a] - xi;
                re[a] += xr;
                im[a] += xi;
            }
    }
    int best = 0;
    float most = 0.0f;
    for (int i = 1; i < count / 2; ++i) {
        float power = re[i] * re[i] + im[i] * im[i];
        if (power > most) {
            most = power;
            best = i;
        }
    }
    return best + most;
}
