// Reads JSON telemetry into a tree of values and sums its numbers.
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "kernel.hpp"

namespace {

struct Value {
    double number = 0.0;
    std::string text;
    std::vector<std::pair<std::string, Value>> members;
    std::vector<Value> items;
};

struct Reader {
    const char* at;

    void blank() {
        while (*at == ' ' || *at == '\n' || *at == '\t')
            ++at;
    }
    bool take(char wanted) {
        blank();
        if (*at != wanted)
            return false;
        ++at;
        return true;
    }
    std::string word() {
        const char* start = ++at;
        while (*at != '"')
            ++at;
        return std::string(start, at++);
    }
    double decimal() {
        bool negative = *at == '-';
        at += negative;
        double value = 0.0, unit = 1.0;
        while (*at >= '0' && *at <= '9')
            value = value * 10.0 + (*at++ - '0');
        if (*at == '.')
            for (++at; *at >= '0' && *at <= '9'; ++at)
                value += (*at - '0') * (unit *= 0.1);
        return negative ? -value : value;
    }
    Value value() {
        Value out;
        blank();
        if (*at == '{') {
            ++at;
            while (!take('}')) {
                blank();
                std::string name = word();
                take(':');
                out.members.emplace_back(std::move(name), value());
                take(',');
            }
        } else if (*at == '[') {
            ++at;
            while (!take(']')) {
                out.items.push_back(value());
                take(',');
            }
        } else if (*at == '"') {
            out.text = word();
        } else {
            out.number = decimal();
        }
        return out;
    }
};

double sum(const Value& value) {
    double total = value.number + static_cast<double>(value.text.size());
    for (const auto& [name, member] : value.members)
        total += sum(member);
    for (const Value& item : value.items)
        total += sum(item);
    return total;
}

std::string document;

}  // namespace

void prepare(int input) {
    Numbers numbers(input);
    document = "[";
    for (int i = 0; i < of(input, 50, 70, 60, 40); ++i) {
        char line[400];
        std::snprintf(line, sizeof line,
                      "%s{\"id\": %d, \"mode\": \"%s\", \"position\": [%.6f, %.6f, %.2f], \"battery\": "
                      "{\"voltage\": %.2f, \"remaining\": %d}",
                      i ? ",\n" : "", i, numbers.below(2) ? "GUIDED" : "A_VERY_LONG_MODE_NAME", numbers.between(-90, 90),
                      numbers.between(-180, 180), numbers.between(0, 100), numbers.between(10, 13), numbers.below(100));
        document += line;
        int ranges = of(input, 0, 12, 7, 3);
        if (ranges > 0) {
            document += ", \"ranges\": [";
            for (int k = 0; k < ranges; ++k)
                document += (k ? "," : "") + std::to_string(numbers.below(3000));
            document += "]";
        }
        document += "}";
    }
    document += "]";
}

double kernel() {
    Reader reader{document.c_str()};
    return sum(reader.value());
}
