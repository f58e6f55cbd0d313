// Searches a log for several keywords by their last character (Horspool), and parses the number after each.
#include <cstring>
#include <string>
#include <vector>

#include "../kernels/kernel.hpp"

namespace {
std::string text;
std::vector<std::string> keywords = {"altitude=", "battery=", "link lost after ", "heading="};
}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    static const char* words[] = {"waypoint ", "altitude=", "rotor ", "battery=", "ok; ",
                                  "heading=",  "link lost after ", "mode ", "hold ", "latitude "};
    text.clear();
    int wanted = of(input, 9000, 14000, 11000, 16000);
    int kinds = of(input, 10, 8, 9, 10);
    while (static_cast<int>(text.size()) < wanted)
        text += words[numbers.below(kinds)] + std::to_string(numbers.below(20000)) + (numbers.below(6) ? " " : "\n");
}

double kernel() {
    double total = 0.0;
    for (const std::string& keyword : keywords) {
        std::size_t length = keyword.size(), skip[256];
        for (std::size_t& one : skip)
            one = length;
        for (std::size_t i = 0; i + 1 < length; ++i)
            skip[static_cast<unsigned char>(keyword[i])] = length - 1 - i;
        for (std::size_t at = 0; at + length < text.size();) {
            std::size_t i = length;
            while (i > 0 && text[at + i - 1] == keyword[i - 1])
                --i;
            if (i == 0) {
                long value = 0;
                for (std::size_t digit = at + length; digit < text.size() && text[digit] >= '0' && text[digit] <= '9'; ++digit)
                    value = value * 10 + (text[digit] - '0');
                total += value;
            }
            at += skip[static_cast<unsigned char>(text[at + length - 1])];
        }
    }
    return total;
}
