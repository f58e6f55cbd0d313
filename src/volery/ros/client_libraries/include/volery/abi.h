// Framework ABI in C++: how a component's code makes requests and which of its functions the framework calls.
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

#include "volery/framework.h"

namespace volery {

// Thrown where a cancelled component waits. Not a std::exception, so that no handler catches it by accident.
struct Cancelled {};

// A request that failed: a vehicle's refusal, an unknown name and so on.
class Error : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

// Encodes arguments: a number takes eight bytes; a text its length and its bytes.
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

// Decodes what a Writer has encoded.
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
        if (static_cast<std::size_t>(end_ - at_) < size) throw std::runtime_error("too few bytes in a reply");
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

// Make a request of the framework and return the reply, which is valid until the next request.
// Throws Error if the request fails and Cancelled if the component is cancelled meanwhile.
Reader request(const char* name, const Writer& arguments = {});

// Make a request in a destructor or in a function that must not throw; return whether it succeeded.
bool try_request(const char* name, const Writer& arguments = {}) noexcept;

// A function that the framework calls by its number.
using Callable = std::function<void(Reader, Writer&)>;

std::int64_t register_callable(Callable callable);  // returns the new number
void register_callable_as(std::int64_t number, Callable callable);
void unregister_callable(std::int64_t number);

// The first numbers are the component's own: construct, run, then its operations.
enum : std::int64_t { MAKE = 0, RUN = 1, OPERATIONS = 2, FREE = 1000 };

}  // namespace volery
