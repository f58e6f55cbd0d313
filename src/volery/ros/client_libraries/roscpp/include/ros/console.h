// ROS_INFO and the other log macros, which record lines in the trace.
#pragma once
#include <cstdio>
#include <cstdlib>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "ros/time.h"
#include "volery/text.h"

namespace ros {
namespace console {

namespace levels {
enum Level { Debug, Info, Warn, Error, Fatal, Count };
}
using Level = levels::Level;

struct FilterParams {
    const char *file = "", *function = "", *message = "";
    int line = 0;
    Level level = levels::Info;
    std::string out_message;
};

// Decides line by line whether it is logged.
class FilterBase {
public:
    virtual ~FilterBase() = default;
    virtual bool isEnabled() { return true; }
    virtual bool isEnabled(FilterParams&) { return true; }
};

// All levels are recorded in the trace, so the logger level has no effect.
inline bool set_logger_level(const std::string&, levels::Level) { return true; }
inline bool get_loggers(std::map<std::string, levels::Level>&) { return true; }
inline void notifyLoggerLevelsChanged() {}
inline void initialize() {}
inline void shutdown() {}

}  // namespace console

namespace detail {

inline void say(console::Level level, const std::string& text) {
    volery::request("ros.log", volery::Writer().put(static_cast<int>(level)).put(text));
}

using volery::formatted;

// Returns whether a line that is logged at most once a period is due; updates the time *last* of the last line. The
// first one is due at once, or with *delayed* after a period.
inline bool due(Time& last, double period, bool delayed = false) {
    auto const now = Time::now();
    bool const first = last.isZero();
    if (!first && now < last + Duration(period)) return false;
    last = now;
    return !(first && delayed);
}

}  // namespace detail
}  // namespace ros

#define ROSCONSOLE_ROOT_LOGGER_NAME "ros"
#ifndef ROS_PACKAGE_NAME
#define ROS_PACKAGE_NAME "unknown_package"
#endif
#define ROSCONSOLE_PACKAGE_NAME ROS_PACKAGE_NAME
#define ROSCONSOLE_NAME_PREFIX ROSCONSOLE_ROOT_LOGGER_NAME "." ROSCONSOLE_PACKAGE_NAME
#define ROSCONSOLE_DEFAULT_NAME ROSCONSOLE_NAME_PREFIX
#define ROSCONSOLE_SEVERITY_DEBUG 0
#define ROSCONSOLE_SEVERITY_INFO 1
#define ROSCONSOLE_SEVERITY_WARN 2
#define ROSCONSOLE_SEVERITY_ERROR 3
#define ROSCONSOLE_SEVERITY_FATAL 4
#define ROSCONSOLE_SEVERITY_NONE 5
#ifndef ROSCONSOLE_MIN_SEVERITY
#define ROSCONSOLE_MIN_SEVERITY ROSCONSOLE_SEVERITY_DEBUG
#endif
#define ROSCONSOLE_AUTOINIT

#define VOLERY_LOG_IF(condition, level, text)                \
    do {                                                     \
        if (condition) ::ros::detail::say((level), (text)); \
    } while (false)
#define VOLERY_LOG_ONCE(level, text)                            \
    do {                                                        \
        static bool volery_said = false;                        \
        if (!volery_said) ::ros::detail::say((level), (text)); \
        volery_said = true;                                     \
    } while (false)
#define VOLERY_LOG_THROTTLE(period, delayed, level, text)                                                 \
    do {                                                                                                  \
        static ::ros::Time volery_last;                                                                   \
        if (::ros::detail::due(volery_last, period, delayed)) ::ros::detail::say((level), (text)); \
    } while (false)
#define VOLERY_TEXT(...) ::ros::detail::formatted(__VA_ARGS__)
#define VOLERY_STREAM(what) (static_cast<const std::ostringstream&>(std::ostringstream() << what)).str()

// The name of a logger has no effect: the trace has the node's.
#define ROS_LOG(level, name, ...) VOLERY_LOG_IF(true, level, VOLERY_TEXT(__VA_ARGS__))
#define ROS_LOG_STREAM(level, name, what) VOLERY_LOG_IF(true, level, VOLERY_STREAM(what))
#define ROS_LOG_COND(condition, level, name, ...) VOLERY_LOG_IF(condition, level, VOLERY_TEXT(__VA_ARGS__))
#define ROS_LOG_STREAM_COND(condition, level, name, what) VOLERY_LOG_IF(condition, level, VOLERY_STREAM(what))
#define ROS_LOG_ONCE(level, name, ...) VOLERY_LOG_ONCE(level, VOLERY_TEXT(__VA_ARGS__))
#define ROS_LOG_STREAM_ONCE(level, name, what) VOLERY_LOG_ONCE(level, VOLERY_STREAM(what))
#define ROS_LOG_THROTTLE(period, level, name, ...) VOLERY_LOG_THROTTLE(period, false, level, VOLERY_TEXT(__VA_ARGS__))
#define ROS_LOG_STREAM_THROTTLE(period, level, name, what) VOLERY_LOG_THROTTLE(period, false, level, VOLERY_STREAM(what))
#define ROS_LOG_DELAYED_THROTTLE(period, level, name, ...) \
    VOLERY_LOG_THROTTLE(period, true, level, VOLERY_TEXT(__VA_ARGS__))
#define ROS_LOG_STREAM_DELAYED_THROTTLE(period, level, name, what) \
    VOLERY_LOG_THROTTLE(period, true, level, VOLERY_STREAM(what))
#define ROS_LOG_FILTER(filter, level, name, ...) VOLERY_LOG_IF((filter)->isEnabled(), level, VOLERY_TEXT(__VA_ARGS__))
#define ROS_LOG_STREAM_FILTER(filter, level, name, what) VOLERY_LOG_IF((filter)->isEnabled(), level, VOLERY_STREAM(what))

#define ROS_DEBUG(...) ROS_LOG(::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_DEBUG_NAMED(name, ...) ROS_LOG(::ros::console::levels::Debug, name, __VA_ARGS__)
#define ROS_DEBUG_STREAM(what) ROS_LOG_STREAM(::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_DEBUG_STREAM_NAMED(name, what) ROS_LOG_STREAM(::ros::console::levels::Debug, name, what)
#define ROS_DEBUG_COND(condition, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_DEBUG_COND_NAMED(condition, name, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Debug, name, __VA_ARGS__)
#define ROS_DEBUG_STREAM_COND(condition, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_DEBUG_STREAM_COND_NAMED(condition, name, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Debug, name, what)
#define ROS_DEBUG_ONCE(...) ROS_LOG_ONCE(::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_DEBUG_ONCE_NAMED(name, ...) ROS_LOG_ONCE(::ros::console::levels::Debug, name, __VA_ARGS__)
#define ROS_DEBUG_STREAM_ONCE(what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_DEBUG_STREAM_ONCE_NAMED(name, what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Debug, name, what)
#define ROS_DEBUG_THROTTLE(period, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_DEBUG_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Debug, name, __VA_ARGS__)
#define ROS_DEBUG_STREAM_THROTTLE(period, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_DEBUG_STREAM_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Debug, name, what)
#define ROS_DEBUG_DELAYED_THROTTLE(period, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_DEBUG_DELAYED_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Debug, name, __VA_ARGS__)
#define ROS_DEBUG_STREAM_DELAYED_THROTTLE(period, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_DEBUG_STREAM_DELAYED_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Debug, name, what)
#define ROS_DEBUG_FILTER(filter, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_DEBUG_FILTER_NAMED(filter, name, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Debug, name, __VA_ARGS__)
#define ROS_DEBUG_STREAM_FILTER(filter, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Debug, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_DEBUG_STREAM_FILTER_NAMED(filter, name, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Debug, name, what)

#define ROS_INFO(...) ROS_LOG(::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_INFO_NAMED(name, ...) ROS_LOG(::ros::console::levels::Info, name, __VA_ARGS__)
#define ROS_INFO_STREAM(what) ROS_LOG_STREAM(::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_INFO_STREAM_NAMED(name, what) ROS_LOG_STREAM(::ros::console::levels::Info, name, what)
#define ROS_INFO_COND(condition, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_INFO_COND_NAMED(condition, name, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Info, name, __VA_ARGS__)
#define ROS_INFO_STREAM_COND(condition, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_INFO_STREAM_COND_NAMED(condition, name, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Info, name, what)
#define ROS_INFO_ONCE(...) ROS_LOG_ONCE(::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_INFO_ONCE_NAMED(name, ...) ROS_LOG_ONCE(::ros::console::levels::Info, name, __VA_ARGS__)
#define ROS_INFO_STREAM_ONCE(what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_INFO_STREAM_ONCE_NAMED(name, what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Info, name, what)
#define ROS_INFO_THROTTLE(period, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_INFO_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Info, name, __VA_ARGS__)
#define ROS_INFO_STREAM_THROTTLE(period, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_INFO_STREAM_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Info, name, what)
#define ROS_INFO_DELAYED_THROTTLE(period, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_INFO_DELAYED_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Info, name, __VA_ARGS__)
#define ROS_INFO_STREAM_DELAYED_THROTTLE(period, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_INFO_STREAM_DELAYED_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Info, name, what)
#define ROS_INFO_FILTER(filter, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_INFO_FILTER_NAMED(filter, name, ...) ROS_LOG_FILTER(filter, ::ros::console::levels::Info, name, __VA_ARGS__)
#define ROS_INFO_STREAM_FILTER(filter, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Info, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_INFO_STREAM_FILTER_NAMED(filter, name, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Info, name, what)

#define ROS_WARN(...) ROS_LOG(::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_WARN_NAMED(name, ...) ROS_LOG(::ros::console::levels::Warn, name, __VA_ARGS__)
#define ROS_WARN_STREAM(what) ROS_LOG_STREAM(::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_WARN_STREAM_NAMED(name, what) ROS_LOG_STREAM(::ros::console::levels::Warn, name, what)
#define ROS_WARN_COND(condition, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_WARN_COND_NAMED(condition, name, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Warn, name, __VA_ARGS__)
#define ROS_WARN_STREAM_COND(condition, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_WARN_STREAM_COND_NAMED(condition, name, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Warn, name, what)
#define ROS_WARN_ONCE(...) ROS_LOG_ONCE(::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_WARN_ONCE_NAMED(name, ...) ROS_LOG_ONCE(::ros::console::levels::Warn, name, __VA_ARGS__)
#define ROS_WARN_STREAM_ONCE(what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_WARN_STREAM_ONCE_NAMED(name, what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Warn, name, what)
#define ROS_WARN_THROTTLE(period, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_WARN_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Warn, name, __VA_ARGS__)
#define ROS_WARN_STREAM_THROTTLE(period, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_WARN_STREAM_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Warn, name, what)
#define ROS_WARN_DELAYED_THROTTLE(period, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_WARN_DELAYED_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Warn, name, __VA_ARGS__)
#define ROS_WARN_STREAM_DELAYED_THROTTLE(period, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_WARN_STREAM_DELAYED_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Warn, name, what)
#define ROS_WARN_FILTER(filter, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_WARN_FILTER_NAMED(filter, name, ...) ROS_LOG_FILTER(filter, ::ros::console::levels::Warn, name, __VA_ARGS__)
#define ROS_WARN_STREAM_FILTER(filter, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Warn, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_WARN_STREAM_FILTER_NAMED(filter, name, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Warn, name, what)

#define ROS_ERROR(...) ROS_LOG(::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_ERROR_NAMED(name, ...) ROS_LOG(::ros::console::levels::Error, name, __VA_ARGS__)
#define ROS_ERROR_STREAM(what) ROS_LOG_STREAM(::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_ERROR_STREAM_NAMED(name, what) ROS_LOG_STREAM(::ros::console::levels::Error, name, what)
#define ROS_ERROR_COND(condition, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_ERROR_COND_NAMED(condition, name, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Error, name, __VA_ARGS__)
#define ROS_ERROR_STREAM_COND(condition, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_ERROR_STREAM_COND_NAMED(condition, name, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Error, name, what)
#define ROS_ERROR_ONCE(...) ROS_LOG_ONCE(::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_ERROR_ONCE_NAMED(name, ...) ROS_LOG_ONCE(::ros::console::levels::Error, name, __VA_ARGS__)
#define ROS_ERROR_STREAM_ONCE(what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_ERROR_STREAM_ONCE_NAMED(name, what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Error, name, what)
#define ROS_ERROR_THROTTLE(period, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_ERROR_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Error, name, __VA_ARGS__)
#define ROS_ERROR_STREAM_THROTTLE(period, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_ERROR_STREAM_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Error, name, what)
#define ROS_ERROR_DELAYED_THROTTLE(period, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_ERROR_DELAYED_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Error, name, __VA_ARGS__)
#define ROS_ERROR_STREAM_DELAYED_THROTTLE(period, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_ERROR_STREAM_DELAYED_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Error, name, what)
#define ROS_ERROR_FILTER(filter, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_ERROR_FILTER_NAMED(filter, name, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Error, name, __VA_ARGS__)
#define ROS_ERROR_STREAM_FILTER(filter, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Error, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_ERROR_STREAM_FILTER_NAMED(filter, name, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Error, name, what)

#define ROS_FATAL(...) ROS_LOG(::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_FATAL_NAMED(name, ...) ROS_LOG(::ros::console::levels::Fatal, name, __VA_ARGS__)
#define ROS_FATAL_STREAM(what) ROS_LOG_STREAM(::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_FATAL_STREAM_NAMED(name, what) ROS_LOG_STREAM(::ros::console::levels::Fatal, name, what)
#define ROS_FATAL_COND(condition, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_FATAL_COND_NAMED(condition, name, ...) \
    ROS_LOG_COND(condition, ::ros::console::levels::Fatal, name, __VA_ARGS__)
#define ROS_FATAL_STREAM_COND(condition, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_FATAL_STREAM_COND_NAMED(condition, name, what) \
    ROS_LOG_STREAM_COND(condition, ::ros::console::levels::Fatal, name, what)
#define ROS_FATAL_ONCE(...) ROS_LOG_ONCE(::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_FATAL_ONCE_NAMED(name, ...) ROS_LOG_ONCE(::ros::console::levels::Fatal, name, __VA_ARGS__)
#define ROS_FATAL_STREAM_ONCE(what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_FATAL_STREAM_ONCE_NAMED(name, what) ROS_LOG_STREAM_ONCE(::ros::console::levels::Fatal, name, what)
#define ROS_FATAL_THROTTLE(period, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_FATAL_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_THROTTLE(period, ::ros::console::levels::Fatal, name, __VA_ARGS__)
#define ROS_FATAL_STREAM_THROTTLE(period, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_FATAL_STREAM_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_THROTTLE(period, ::ros::console::levels::Fatal, name, what)
#define ROS_FATAL_DELAYED_THROTTLE(period, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_FATAL_DELAYED_THROTTLE_NAMED(period, name, ...) \
    ROS_LOG_DELAYED_THROTTLE(period, ::ros::console::levels::Fatal, name, __VA_ARGS__)
#define ROS_FATAL_STREAM_DELAYED_THROTTLE(period, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_FATAL_STREAM_DELAYED_THROTTLE_NAMED(period, name, what) \
    ROS_LOG_STREAM_DELAYED_THROTTLE(period, ::ros::console::levels::Fatal, name, what)
#define ROS_FATAL_FILTER(filter, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, __VA_ARGS__)
#define ROS_FATAL_FILTER_NAMED(filter, name, ...) \
    ROS_LOG_FILTER(filter, ::ros::console::levels::Fatal, name, __VA_ARGS__)
#define ROS_FATAL_STREAM_FILTER(filter, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Fatal, ROSCONSOLE_DEFAULT_NAME, what)
#define ROS_FATAL_STREAM_FILTER_NAMED(filter, name, what) \
    ROS_LOG_STREAM_FILTER(filter, ::ros::console::levels::Fatal, name, what)

#define ROS_ASSERT_ENABLED
#define ROS_ASSERT(condition)                                                       \
    do {                                                                            \
        if (!(condition)) {                                                         \
            ROS_FATAL("ASSERTION FAILED: %s (%s:%d)", #condition, __FILE__, __LINE__); \
            std::abort();                                                           \
        }                                                                           \
    } while (false)
#define ROS_ASSERT_MSG(condition, ...)                                              \
    do {                                                                            \
        if (!(condition)) {                                                         \
            ROS_FATAL("ASSERTION FAILED: %s (%s:%d)", #condition, __FILE__, __LINE__); \
            ROS_FATAL(__VA_ARGS__);                                                 \
            std::abort();                                                           \
        }                                                                           \
    } while (false)
#define ROS_ASSERT_CMD(condition, command) \
    do {                                   \
        if (!(condition)) command;         \
    } while (false)
#define ROS_BREAK() ROS_ASSERT(false)
#define ROS_COMPILE_ASSERT(condition) static_assert(condition, #condition)
#define ROS_STATIC_ASSERT(condition) static_assert(condition, #condition)
