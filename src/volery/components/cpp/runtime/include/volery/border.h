// How C++ code of a component asks the house for something, and how the house calls it.
#pragma once
#include <cstdint>
#include <cstring>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "volery/house.h"

namespace volery {

// The component is ended. No std::exception, lest it is caught by accident.
struct Ended {};

// A question that failed: a vehicle that refused, a name that is none, and so on.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

// Numbers take eight bytes, texts their length and their bytes.
class Writer {
public:
    Writer& put(std::int64_t value) { return raw(&value, sizeof value); }
    Writer& put(int value) { return put(static_cast<std::int64_t>(value)); }
    Writer& put(bool value) { return put(static_cast<std::int64_t>(value)); }
    Writer& put(std::size_t value) { return put(static_cast<std::int64_t>(value)); }
    Writer& put(double value) { return raw(&value, sizeof value); }
    Writer& put(const std::string& text) { return put(text.data(), text.size()); }
    Writer& put(const char* text) { return put(text, std::strlen(text)); }
    Writer& put(const char* data, std::size_t size) {
        put(size);
        return raw(data, size);
    }
    const std::string& bytes() const { return bytes_; }

private:
    Writer& raw(const void* data, std::size_t size) {
        bytes_.append(static_cast<const char*>(data), size);
        return *this;
    }
    std::string bytes_;
};

class Reader {
public:
    Reader(const char* data, std::size_t size) : at_(data), end_(data + size) {}
    std::int64_t integer() { return number<std::int64_t>(); }
    double real() { return number<double>(); }
    bool flag() { return integer() != 0; }
    std::string text() {
        auto const size = static_cast<std::size_t>(integer());
        return std::string(take(size), size);
    }
    const char* take(std::size_t size) {
        if (static_cast<std::size_t>(end_ - at_) < size) throw std::runtime_error("too few bytes at the border");
        const char* here = at_;
        at_ += size;
        return here;
    }
    std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }

private:
    template <class Number>
    Number number() {
        Number value;
        std::memcpy(&value, take(sizeof value), sizeof value);
        return value;
    }
    const char* at_;
    const char* end_;
};

// Ask, and give what comes back: valid until the next question.
Reader ask(const char* question, const Writer& with = {});

// The same for destructors and for functions that must not throw. Whether there was an answer.
bool tell(const char* question, const Writer& with = {}) noexcept;

// What the house may call, by number.
using Callable = std::function<void(Reader, Writer&)>;

std::int64_t enlist(Callable callable);             // give it a number of its own
void enlist_as(std::int64_t number, Callable callable);
void forget(std::int64_t number);

// The first numbers are the component's: to construct it, to run it, then its operations.
enum : std::int64_t { MAKE = 0, RUN = 1, OPERATIONS = 2, FREE = 1000 };

}  // namespace volery
