// ROS_INFO and the other log macros, which record lines in the trace.
#pragma once
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "ros/time.h"

namespace ros {
namespace console {

namespace levels {
enum Level { Debug, Info, Warn, Error, Fatal, Count };
}
using Level = levels::Level;

// All levels are recorded in the trace, so the logger level has no effect.
inline bool set_logger_level(const std::string&, levels::Level) { return true; }
inline void notifyLoggerLevelsChanged() {}

}  // namespace console

namespace detail {

inline void say(console::Level level, const std::string& text) {
    volery::request("ros.log", volery::Writer().put(static_cast<int>(level)).put(text));
}

__attribute__((format(printf, 1, 2))) inline std::string formatted(const char* format, ...) {
    std::va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    std::vector<char> text(static_cast<std::size_t>(std::vsnprintf(nullptr, 0, format, arguments)) + 1);
    std::vsnprintf(text.data(), text.size(), format, again);
    va_end(again);
    va_end(arguments);
    return text.data();
}

// Returns whether a line that is logged at most once a period is due; updates the time *last* of the last line.
inline bool due(Time& last, double period) {
    auto const now = Time::now();
    if (!last.isZero() && now < last + Duration(period)) return false;
    last = now;
    return true;
}

}  // namespace detail
}  // namespace ros

#define ROSCONSOLE_DEFAULT_NAME "ros"

#define VOLERY_LOG_IF(condition, level, text)                             \
    do {                                                                  \
        if (condition) ::ros::detail::say(::ros::console::levels::level, text); \
    } while (false)
#define VOLERY_LOG_ONCE(level, text)                                      \
    do {                                                                  \
        static bool volery_said = false;                                  \
        if (!volery_said) ::ros::detail::say(::ros::console::levels::level, text); \
        volery_said = true;                                               \
    } while (false)
#define VOLERY_LOG_THROTTLE(period, level, text)                          \
    do {                                                                  \
        static ::ros::Time volery_last;                                   \
        if (::ros::detail::due(volery_last, period)) ::ros::detail::say(::ros::console::levels::level, text); \
    } while (false)
#define VOLERY_TEXT(...) ::ros::detail::formatted(__VA_ARGS__)
#define VOLERY_STREAM(what) (static_cast<const std::ostringstream&>(std::ostringstream() << what)).str()

#define ROS_DEBUG(...) VOLERY_LOG_IF(true, Debug, VOLERY_TEXT(__VA_ARGS__))
#define ROS_DEBUG_STREAM(what) VOLERY_LOG_IF(true, Debug, VOLERY_STREAM(what))
#define ROS_DEBUG_COND(condition, ...) VOLERY_LOG_IF(condition, Debug, VOLERY_TEXT(__VA_ARGS__))
#define ROS_DEBUG_STREAM_COND(condition, what) VOLERY_LOG_IF(condition, Debug, VOLERY_STREAM(what))
#define ROS_DEBUG_ONCE(...) VOLERY_LOG_ONCE(Debug, VOLERY_TEXT(__VA_ARGS__))
#define ROS_DEBUG_STREAM_ONCE(what) VOLERY_LOG_ONCE(Debug, VOLERY_STREAM(what))
#define ROS_DEBUG_THROTTLE(period, ...) VOLERY_LOG_THROTTLE(period, Debug, VOLERY_TEXT(__VA_ARGS__))
#define ROS_DEBUG_STREAM_THROTTLE(period, what) VOLERY_LOG_THROTTLE(period, Debug, VOLERY_STREAM(what))
#define ROS_DEBUG_NAMED(name, ...) ROS_DEBUG(__VA_ARGS__)
#define ROS_DEBUG_STREAM_NAMED(name, what) ROS_DEBUG_STREAM(what)

#define ROS_INFO(...) VOLERY_LOG_IF(true, Info, VOLERY_TEXT(__VA_ARGS__))
#define ROS_INFO_STREAM(what) VOLERY_LOG_IF(true, Info, VOLERY_STREAM(what))
#define ROS_INFO_COND(condition, ...) VOLERY_LOG_IF(condition, Info, VOLERY_TEXT(__VA_ARGS__))
#define ROS_INFO_STREAM_COND(condition, what) VOLERY_LOG_IF(condition, Info, VOLERY_STREAM(what))
#define ROS_INFO_ONCE(...) VOLERY_LOG_ONCE(Info, VOLERY_TEXT(__VA_ARGS__))
#define ROS_INFO_STREAM_ONCE(what) VOLERY_LOG_ONCE(Info, VOLERY_STREAM(what))
#define ROS_INFO_THROTTLE(period, ...) VOLERY_LOG_THROTTLE(period, Info, VOLERY_TEXT(__VA_ARGS__))
#define ROS_INFO_STREAM_THROTTLE(period, what) VOLERY_LOG_THROTTLE(period, Info, VOLERY_STREAM(what))
#define ROS_INFO_NAMED(name, ...) ROS_INFO(__VA_ARGS__)
#define ROS_INFO_STREAM_NAMED(name, what) ROS_INFO_STREAM(what)

#define ROS_WARN(...) VOLERY_LOG_IF(true, Warn, VOLERY_TEXT(__VA_ARGS__))
#define ROS_WARN_STREAM(what) VOLERY_LOG_IF(true, Warn, VOLERY_STREAM(what))
#define ROS_WARN_COND(condition, ...) VOLERY_LOG_IF(condition, Warn, VOLERY_TEXT(__VA_ARGS__))
#define ROS_WARN_STREAM_COND(condition, what) VOLERY_LOG_IF(condition, Warn, VOLERY_STREAM(what))
#define ROS_WARN_ONCE(...) VOLERY_LOG_ONCE(Warn, VOLERY_TEXT(__VA_ARGS__))
#define ROS_WARN_STREAM_ONCE(what) VOLERY_LOG_ONCE(Warn, VOLERY_STREAM(what))
#define ROS_WARN_THROTTLE(period, ...) VOLERY_LOG_THROTTLE(period, Warn, VOLERY_TEXT(__VA_ARGS__))
#define ROS_WARN_STREAM_THROTTLE(period, what) VOLERY_LOG_THROTTLE(period, Warn, VOLERY_STREAM(what))
#define ROS_WARN_NAMED(name, ...) ROS_WARN(__VA_ARGS__)
#define ROS_WARN_STREAM_NAMED(name, what) ROS_WARN_STREAM(what)

#define ROS_ERROR(...) VOLERY_LOG_IF(true, Error, VOLERY_TEXT(__VA_ARGS__))
#define ROS_ERROR_STREAM(what) VOLERY_LOG_IF(true, Error, VOLERY_STREAM(what))
#define ROS_ERROR_COND(condition, ...) VOLERY_LOG_IF(condition, Error, VOLERY_TEXT(__VA_ARGS__))
#define ROS_ERROR_STREAM_COND(condition, what) VOLERY_LOG_IF(condition, Error, VOLERY_STREAM(what))
#define ROS_ERROR_ONCE(...) VOLERY_LOG_ONCE(Error, VOLERY_TEXT(__VA_ARGS__))
#define ROS_ERROR_STREAM_ONCE(what) VOLERY_LOG_ONCE(Error, VOLERY_STREAM(what))
#define ROS_ERROR_THROTTLE(period, ...) VOLERY_LOG_THROTTLE(period, Error, VOLERY_TEXT(__VA_ARGS__))
#define ROS_ERROR_STREAM_THROTTLE(period, what) VOLERY_LOG_THROTTLE(period, Error, VOLERY_STREAM(what))
#define ROS_ERROR_NAMED(name, ...) ROS_ERROR(__VA_ARGS__)
#define ROS_ERROR_STREAM_NAMED(name, what) ROS_ERROR_STREAM(what)

#define ROS_FATAL(...) VOLERY_LOG_IF(true, Fatal, VOLERY_TEXT(__VA_ARGS__))
#define ROS_FATAL_STREAM(what) VOLERY_LOG_IF(true, Fatal, VOLERY_STREAM(what))
#define ROS_FATAL_COND(condition, ...) VOLERY_LOG_IF(condition, Fatal, VOLERY_TEXT(__VA_ARGS__))
#define ROS_FATAL_STREAM_COND(condition, what) VOLERY_LOG_IF(condition, Fatal, VOLERY_STREAM(what))
#define ROS_FATAL_ONCE(...) VOLERY_LOG_ONCE(Fatal, VOLERY_TEXT(__VA_ARGS__))
#define ROS_FATAL_STREAM_ONCE(what) VOLERY_LOG_ONCE(Fatal, VOLERY_STREAM(what))
#define ROS_FATAL_THROTTLE(period, ...) VOLERY_LOG_THROTTLE(period, Fatal, VOLERY_TEXT(__VA_ARGS__))
#define ROS_FATAL_STREAM_THROTTLE(period, what) VOLERY_LOG_THROTTLE(period, Fatal, VOLERY_STREAM(what))
#define ROS_FATAL_NAMED(name, ...) ROS_FATAL(__VA_ARGS__)
#define ROS_FATAL_STREAM_NAMED(name, what) ROS_FATAL_STREAM(what)

#define ROS_ASSERT(condition)                                                       \
    do {                                                                            \
        if (!(condition)) {                                                         \
            ROS_FATAL("ASSERTION FAILED: %s (%s:%d)", #condition, __FILE__, __LINE__); \
            std::abort();                                                           \
        }                                                                           \
    } while (false)
#define ROS_BREAK() ROS_ASSERT(false)
