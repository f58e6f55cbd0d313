// Calls of any C++ component to the run that it is part of.
#pragma once
#include <string>

#include "volery/abi.h"

namespace volery {

// Return the seconds since the start of the run.
inline double now() { return request("now").real(); }

// Block for some seconds of the run.
inline void sleep(double seconds) { request("sleep", Writer().put(seconds)); }

// Charge the component for computing that is neither stated nor counted: seconds of execution time on its
// processor, stated at the frequency at_mhz if that is above 0, and joules where they are known.
inline void add_time(double seconds, double at_mhz = 0.0, double joules = 0.0) {
    request("add_time", Writer().put(seconds).put(at_mhz).put(joules));
}

// Record a line of text. The severity is "error", "warning", "info" or "debug".
inline void log(const std::string& text, const std::string& severity = "info") {
    request("log", Writer().put(text).put(severity));
}

// Record that something which the application follows has entered a state: note("point", "gate", "inspected").
inline void note(const std::string& kind, const std::string& subject, const std::string& state,
                 const std::string& detail = "") {
    request("note", Writer().put(kind).put(subject).put(state).put(detail));
}

inline Reader parameter_(const std::string& name, const char* kind) {
    return request("parameter", Writer().put(name).put(kind));
}

// Return a parameter of the model.
template <class Value>
Value parameter(const std::string& name);
template <>
inline bool parameter<bool>(const std::string& name) {
    return parameter_(name, "bool").flag();
}
template <>
inline int parameter<int>(const std::string& name) {
    return static_cast<int>(parameter_(name, "int").integer());
}
template <>
inline double parameter<double>(const std::string& name) {
    return parameter_(name, "float").real();
}
template <>
inline std::string parameter<std::string>(const std::string& name) {
    return parameter_(name, "str").text();
}

}  // namespace volery

// add_time under its name in early-design models.
inline void uc_add_times(double seconds, double joules = 0.0) { volery::add_time(seconds, 0.0, joules); }
