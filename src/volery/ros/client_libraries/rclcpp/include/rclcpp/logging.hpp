// rclcpp::Logger and RCLCPP_INFO with its siblings, which record lines in the trace.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <sstream>
#include <string>

#include "rclcpp/context.hpp"
#include "rclcpp/time.hpp"
#include "volery/text.h"

enum RCUTILS_LOG_SEVERITY {
    RCUTILS_LOG_SEVERITY_UNSET = 0,
    RCUTILS_LOG_SEVERITY_DEBUG = 10,
    RCUTILS_LOG_SEVERITY_INFO = 20,
    RCUTILS_LOG_SEVERITY_WARN = 30,
    RCUTILS_LOG_SEVERITY_ERROR = 40,
    RCUTILS_LOG_SEVERITY_FATAL = 50,
};

namespace rclcpp {

namespace detail {

// The levels that were set, by the names of the loggers.
inline std::map<std::string, int>& levels() {
    static std::map<std::string, int> all;
    return all;
}
inline int effective_level(std::string name) {
    while (true) {
        auto const found = levels().find(name);
        if (found != levels().end() && found->second != 0) return found->second;
        if (name.empty()) return RCUTILS_LOG_SEVERITY_INFO;
        auto const dot = name.rfind('.');
        name = dot == std::string::npos ? "" : name.substr(0, dot);
    }
}

}  // namespace detail

class Logger {
public:
    enum class Level { Unset = 0, Debug = 10, Info = 20, Warn = 30, Error = 40, Fatal = 50 };

    explicit Logger(std::string name = "") : name_(std::move(name)) {}
    const char* get_name() const { return name_.c_str(); }
    Logger get_child(const std::string& suffix) const { return Logger(name_.empty() ? suffix : name_ + "." + suffix); }
    void set_level(Level level) { detail::levels()[name_] = static_cast<int>(level); }
    Level get_effective_level() const { return static_cast<Level>(detail::effective_level(name_)); }

private:
    std::string name_;
};

inline Logger get_logger(const std::string& name) { return Logger(name); }
inline Logger get_node_logger(const void*) { return Logger(); }

namespace detail {

inline bool enabled(const Logger& logger, int level) { return level >= static_cast<int>(logger.get_effective_level()); }
inline void say(int level, const std::string& text) {
    volery::request("ros.log", volery::Writer().put(level / 10 - 1).put(text));
}

// Decides whether a line that is logged at most once a period, in ms, is due.
class Throttle {
public:
    bool due(const Clock& clock, double period_ms) {
        auto const now = clock.now().nanoseconds();
        if (said_ && now < last_ + static_cast<std::int64_t>(period_ms * 1e6)) return false;
        said_ = true;
        last_ = now;
        return true;
    }

private:
    bool said_ = false;
    std::int64_t last_ = 0;
};

}  // namespace detail
}  // namespace rclcpp

inline int rcutils_logging_set_logger_level(const char* name, int level) {
    rclcpp::detail::levels()[name] = level;
    return 0;
}

#define VOLERY_LOG(logger, level, condition, text)                                                \
    do {                                                                                          \
        static_assert(std::is_same_v<std::remove_cv_t<std::remove_reference_t<decltype(logger)>>, \
                                     ::rclcpp::Logger>,                                           \
                      "First argument to logging macros must be an rclcpp::Logger");              \
        if (::rclcpp::detail::enabled(logger, RCUTILS_LOG_SEVERITY_##level) && (condition))       \
            ::rclcpp::detail::say(RCUTILS_LOG_SEVERITY_##level, text);                            \
    } while (false)
#define VOLERY_TEXT(...) ::volery::formatted(__VA_ARGS__)
#define VOLERY_STREAM(what) (static_cast<const std::ostringstream&>(std::ostringstream() << what)).str()
// Conditions that remember something at the place of the macro.
#define VOLERY_ONCE ([] { static bool said = false; return !std::exchange(said, true); }())
#define VOLERY_AFTER_FIRST ([] { static bool first = true; return !std::exchange(first, false); }())
#define VOLERY_DUE(clock, period) \
    ([&](const ::rclcpp::Clock& shown, double span) { static ::rclcpp::detail::Throttle throttle; return throttle.due(shown, span); }(clock, static_cast<double>(period)))

#define RCLCPP_DEBUG(logger, ...) VOLERY_LOG(logger, DEBUG, true, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_DEBUG_STREAM(logger, what) VOLERY_LOG(logger, DEBUG, true, VOLERY_STREAM(what))
#define RCLCPP_DEBUG_ONCE(logger, ...) VOLERY_LOG(logger, DEBUG, VOLERY_ONCE, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_DEBUG_STREAM_ONCE(logger, what) VOLERY_LOG(logger, DEBUG, VOLERY_ONCE, VOLERY_STREAM(what))
#define RCLCPP_DEBUG_EXPRESSION(logger, expression, ...) VOLERY_LOG(logger, DEBUG, (expression), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_DEBUG_STREAM_EXPRESSION(logger, expression, what) VOLERY_LOG(logger, DEBUG, (expression), VOLERY_STREAM(what))
#define RCLCPP_DEBUG_FUNCTION(logger, function, ...) VOLERY_LOG(logger, DEBUG, (*function)(), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_DEBUG_STREAM_FUNCTION(logger, function, what) VOLERY_LOG(logger, DEBUG, (*function)(), VOLERY_STREAM(what))
#define RCLCPP_DEBUG_SKIPFIRST(logger, ...) VOLERY_LOG(logger, DEBUG, VOLERY_AFTER_FIRST, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_DEBUG_STREAM_SKIPFIRST(logger, what) VOLERY_LOG(logger, DEBUG, VOLERY_AFTER_FIRST, VOLERY_STREAM(what))
#define RCLCPP_DEBUG_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, DEBUG, VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_DEBUG_STREAM_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, DEBUG, VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_DEBUG_SKIPFIRST_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, DEBUG, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_DEBUG_STREAM_SKIPFIRST_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, DEBUG, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_INFO(logger, ...) VOLERY_LOG(logger, INFO, true, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_INFO_STREAM(logger, what) VOLERY_LOG(logger, INFO, true, VOLERY_STREAM(what))
#define RCLCPP_INFO_ONCE(logger, ...) VOLERY_LOG(logger, INFO, VOLERY_ONCE, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_INFO_STREAM_ONCE(logger, what) VOLERY_LOG(logger, INFO, VOLERY_ONCE, VOLERY_STREAM(what))
#define RCLCPP_INFO_EXPRESSION(logger, expression, ...) VOLERY_LOG(logger, INFO, (expression), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_INFO_STREAM_EXPRESSION(logger, expression, what) VOLERY_LOG(logger, INFO, (expression), VOLERY_STREAM(what))
#define RCLCPP_INFO_FUNCTION(logger, function, ...) VOLERY_LOG(logger, INFO, (*function)(), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_INFO_STREAM_FUNCTION(logger, function, what) VOLERY_LOG(logger, INFO, (*function)(), VOLERY_STREAM(what))
#define RCLCPP_INFO_SKIPFIRST(logger, ...) VOLERY_LOG(logger, INFO, VOLERY_AFTER_FIRST, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_INFO_STREAM_SKIPFIRST(logger, what) VOLERY_LOG(logger, INFO, VOLERY_AFTER_FIRST, VOLERY_STREAM(what))
#define RCLCPP_INFO_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, INFO, VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_INFO_STREAM_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, INFO, VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_INFO_SKIPFIRST_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, INFO, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_INFO_STREAM_SKIPFIRST_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, INFO, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_WARN(logger, ...) VOLERY_LOG(logger, WARN, true, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_WARN_STREAM(logger, what) VOLERY_LOG(logger, WARN, true, VOLERY_STREAM(what))
#define RCLCPP_WARN_ONCE(logger, ...) VOLERY_LOG(logger, WARN, VOLERY_ONCE, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_WARN_STREAM_ONCE(logger, what) VOLERY_LOG(logger, WARN, VOLERY_ONCE, VOLERY_STREAM(what))
#define RCLCPP_WARN_EXPRESSION(logger, expression, ...) VOLERY_LOG(logger, WARN, (expression), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_WARN_STREAM_EXPRESSION(logger, expression, what) VOLERY_LOG(logger, WARN, (expression), VOLERY_STREAM(what))
#define RCLCPP_WARN_FUNCTION(logger, function, ...) VOLERY_LOG(logger, WARN, (*function)(), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_WARN_STREAM_FUNCTION(logger, function, what) VOLERY_LOG(logger, WARN, (*function)(), VOLERY_STREAM(what))
#define RCLCPP_WARN_SKIPFIRST(logger, ...) VOLERY_LOG(logger, WARN, VOLERY_AFTER_FIRST, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_WARN_STREAM_SKIPFIRST(logger, what) VOLERY_LOG(logger, WARN, VOLERY_AFTER_FIRST, VOLERY_STREAM(what))
#define RCLCPP_WARN_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, WARN, VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_WARN_STREAM_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, WARN, VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_WARN_SKIPFIRST_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, WARN, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_WARN_STREAM_SKIPFIRST_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, WARN, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_ERROR(logger, ...) VOLERY_LOG(logger, ERROR, true, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_ERROR_STREAM(logger, what) VOLERY_LOG(logger, ERROR, true, VOLERY_STREAM(what))
#define RCLCPP_ERROR_ONCE(logger, ...) VOLERY_LOG(logger, ERROR, VOLERY_ONCE, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_ERROR_STREAM_ONCE(logger, what) VOLERY_LOG(logger, ERROR, VOLERY_ONCE, VOLERY_STREAM(what))
#define RCLCPP_ERROR_EXPRESSION(logger, expression, ...) VOLERY_LOG(logger, ERROR, (expression), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_ERROR_STREAM_EXPRESSION(logger, expression, what) VOLERY_LOG(logger, ERROR, (expression), VOLERY_STREAM(what))
#define RCLCPP_ERROR_FUNCTION(logger, function, ...) VOLERY_LOG(logger, ERROR, (*function)(), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_ERROR_STREAM_FUNCTION(logger, function, what) VOLERY_LOG(logger, ERROR, (*function)(), VOLERY_STREAM(what))
#define RCLCPP_ERROR_SKIPFIRST(logger, ...) VOLERY_LOG(logger, ERROR, VOLERY_AFTER_FIRST, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_ERROR_STREAM_SKIPFIRST(logger, what) VOLERY_LOG(logger, ERROR, VOLERY_AFTER_FIRST, VOLERY_STREAM(what))
#define RCLCPP_ERROR_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, ERROR, VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_ERROR_STREAM_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, ERROR, VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_ERROR_SKIPFIRST_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, ERROR, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_ERROR_STREAM_SKIPFIRST_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, ERROR, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_FATAL(logger, ...) VOLERY_LOG(logger, FATAL, true, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_FATAL_STREAM(logger, what) VOLERY_LOG(logger, FATAL, true, VOLERY_STREAM(what))
#define RCLCPP_FATAL_ONCE(logger, ...) VOLERY_LOG(logger, FATAL, VOLERY_ONCE, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_FATAL_STREAM_ONCE(logger, what) VOLERY_LOG(logger, FATAL, VOLERY_ONCE, VOLERY_STREAM(what))
#define RCLCPP_FATAL_EXPRESSION(logger, expression, ...) VOLERY_LOG(logger, FATAL, (expression), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_FATAL_STREAM_EXPRESSION(logger, expression, what) VOLERY_LOG(logger, FATAL, (expression), VOLERY_STREAM(what))
#define RCLCPP_FATAL_FUNCTION(logger, function, ...) VOLERY_LOG(logger, FATAL, (*function)(), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_FATAL_STREAM_FUNCTION(logger, function, what) VOLERY_LOG(logger, FATAL, (*function)(), VOLERY_STREAM(what))
#define RCLCPP_FATAL_SKIPFIRST(logger, ...) VOLERY_LOG(logger, FATAL, VOLERY_AFTER_FIRST, VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_FATAL_STREAM_SKIPFIRST(logger, what) VOLERY_LOG(logger, FATAL, VOLERY_AFTER_FIRST, VOLERY_STREAM(what))
#define RCLCPP_FATAL_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, FATAL, VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_FATAL_STREAM_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, FATAL, VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
#define RCLCPP_FATAL_SKIPFIRST_THROTTLE(logger, clock, duration, ...) VOLERY_LOG(logger, FATAL, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_TEXT(__VA_ARGS__))
#define RCLCPP_FATAL_STREAM_SKIPFIRST_THROTTLE(logger, clock, duration, what) VOLERY_LOG(logger, FATAL, VOLERY_AFTER_FIRST && VOLERY_DUE(clock, duration), VOLERY_STREAM(what))
