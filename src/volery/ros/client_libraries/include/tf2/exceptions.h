// Exceptions of tf2.
#pragma once
#include <stdexcept>
#include <string>

namespace tf2 {

struct TransformException : std::runtime_error {
    using std::runtime_error::runtime_error;
};
struct ConnectivityException : TransformException {
    using TransformException::TransformException;
};
struct LookupException : TransformException {
    using TransformException::TransformException;
};
struct ExtrapolationException : TransformException {
    using TransformException::TransformException;
};
struct InvalidArgumentException : TransformException {
    using TransformException::TransformException;
};
struct TimeoutException : TransformException {
    using TransformException::TransformException;
};

namespace detail {

// Throw the exception that the graph names by its kind.
[[noreturn]] inline void raise(const std::string& kind, const std::string& text) {
    if (kind == "ConnectivityException") throw ConnectivityException(text);
    if (kind == "LookupException") throw LookupException(text);
    if (kind == "ExtrapolationException") throw ExtrapolationException(text);
    if (kind == "InvalidArgumentException") throw InvalidArgumentException(text);
    throw TransformException(text);
}

}  // namespace detail
}  // namespace tf2
