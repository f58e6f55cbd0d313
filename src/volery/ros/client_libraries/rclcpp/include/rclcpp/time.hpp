// rclcpp::Time, Duration, Clock and Rate. All clocks show the time of the graph.
#pragma once
#include <math.h>  // user code relies on its names without std::

#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "builtin_interfaces/msg/duration.hpp"
#include "builtin_interfaces/msg/time.hpp"
#include "rclcpp/context.hpp"

enum rcl_clock_type_t { RCL_CLOCK_UNINITIALIZED, RCL_ROS_TIME, RCL_SYSTEM_TIME, RCL_STEADY_TIME };
using rcl_clock_type_e = rcl_clock_type_t;
using rcl_time_point_value_t = std::int64_t;
using rcl_duration_value_t = std::int64_t;
struct rmw_time_t {
    std::uint64_t sec, nsec;
};
using rmw_time_s = rmw_time_t;

namespace rclcpp {
namespace detail {

constexpr std::int64_t SECOND = 1000000000;

inline std::int64_t sum(std::int64_t a, std::int64_t b) {
    std::int64_t made = 0;
    if (__builtin_add_overflow(a, b, &made))
        throw a > 0 ? static_cast<const std::runtime_error&>(std::overflow_error("addition leads to int64_t overflow"))
                    : std::underflow_error("addition leads to int64_t underflow");
    return made;
}
template <class Message>
Message divided(std::int64_t nanoseconds) {
    Message made;
    auto const rest = ((nanoseconds % SECOND) + SECOND) % SECOND;
    made.sec = static_cast<std::int32_t>((nanoseconds - rest) / SECOND);
    made.nanosec = static_cast<std::uint32_t>(rest);
    return made;
}

}  // namespace detail

class Duration {
public:
    Duration() = default;
    Duration(std::int32_t seconds, std::uint32_t nanoseconds)
        : nanoseconds_(seconds * detail::SECOND + nanoseconds) {}
    explicit Duration(std::chrono::nanoseconds span) : nanoseconds_(span.count()) {}
    template <class Rep, class Period>
    Duration(const std::chrono::duration<Rep, Period>& span)
        : nanoseconds_(std::chrono::duration_cast<std::chrono::nanoseconds>(span).count()) {}
    Duration(const builtin_interfaces::msg::Duration& message)
        : nanoseconds_(message.sec * detail::SECOND + message.nanosec) {}

    static Duration from_seconds(double seconds) { return from_nanoseconds(static_cast<std::int64_t>(std::llround(seconds * 1e9))); }
    static Duration from_nanoseconds(rcl_duration_value_t nanoseconds) {
        Duration made;
        made.nanoseconds_ = nanoseconds;
        return made;
    }
    static Duration from_rmw_time(rmw_time_t time) {
        return from_nanoseconds(static_cast<std::int64_t>(time.sec) * detail::SECOND + static_cast<std::int64_t>(time.nsec));
    }
    static Duration max() { return from_nanoseconds(std::numeric_limits<std::int64_t>::max()); }

    operator builtin_interfaces::msg::Duration() const {
        return detail::divided<builtin_interfaces::msg::Duration>(nanoseconds_);
    }
    rcl_duration_value_t nanoseconds() const { return nanoseconds_; }
    double seconds() const { return std::chrono::duration<double>(std::chrono::nanoseconds(nanoseconds_)).count(); }
    rmw_time_t to_rmw_time() const {
        return {static_cast<std::uint64_t>(nanoseconds_ / detail::SECOND), static_cast<std::uint64_t>(nanoseconds_ % detail::SECOND)};
    }
    template <class Span>
    Span to_chrono() const {
        return std::chrono::duration_cast<Span>(std::chrono::nanoseconds(nanoseconds_));
    }

    bool operator==(const Duration& other) const { return nanoseconds_ == other.nanoseconds_; }
    bool operator!=(const Duration& other) const { return nanoseconds_ != other.nanoseconds_; }
    bool operator<(const Duration& other) const { return nanoseconds_ < other.nanoseconds_; }
    bool operator<=(const Duration& other) const { return nanoseconds_ <= other.nanoseconds_; }
    bool operator>(const Duration& other) const { return nanoseconds_ > other.nanoseconds_; }
    bool operator>=(const Duration& other) const { return nanoseconds_ >= other.nanoseconds_; }
    Duration operator+(const Duration& other) const { return from_nanoseconds(detail::sum(nanoseconds_, other.nanoseconds_)); }
    Duration operator-(const Duration& other) const { return from_nanoseconds(detail::sum(nanoseconds_, -other.nanoseconds_)); }
    Duration& operator+=(const Duration& other) { return *this = *this + other; }
    Duration& operator-=(const Duration& other) { return *this = *this - other; }
    Duration operator*(double factor) const {
        if (!std::isfinite(factor)) throw std::runtime_error("abnormal scale in rclcpp::Duration");
        return from_nanoseconds(static_cast<std::int64_t>(static_cast<long double>(nanoseconds_) * factor));
    }
    Duration& operator*=(double factor) { return *this = *this * factor; }

private:
    std::int64_t nanoseconds_ = 0;
};

class Clock;

class Time {
public:
    Time(std::int32_t seconds, std::uint32_t nanoseconds, rcl_clock_type_t clock_type = RCL_SYSTEM_TIME)
        : nanoseconds_(checked(seconds) * detail::SECOND + nanoseconds), clock_type_(clock_type) {}
    explicit Time(std::int64_t nanoseconds = 0, rcl_clock_type_t clock_type = RCL_SYSTEM_TIME)
        : nanoseconds_(checked(nanoseconds)), clock_type_(clock_type) {}
    Time(const builtin_interfaces::msg::Time& message, rcl_clock_type_t clock_type = RCL_ROS_TIME)
        : nanoseconds_(checked(message.sec) * detail::SECOND + message.nanosec), clock_type_(clock_type) {}

    static Time max(rcl_clock_type_t clock_type = RCL_SYSTEM_TIME) {
        return Time(std::numeric_limits<std::int32_t>::max(), 999999999, clock_type);
    }
    Time& operator=(const builtin_interfaces::msg::Time& message) { return *this = Time(message); }
    operator builtin_interfaces::msg::Time() const {
        return detail::divided<builtin_interfaces::msg::Time>(nanoseconds_);
    }
    rcl_time_point_value_t nanoseconds() const { return nanoseconds_; }
    double seconds() const { return std::chrono::duration<double>(std::chrono::nanoseconds(nanoseconds_)).count(); }
    rcl_clock_type_t get_clock_type() const { return clock_type_; }

    bool operator==(const Time& other) const { return same(other), nanoseconds_ == other.nanoseconds_; }
    bool operator!=(const Time& other) const { return !(*this == other); }
    bool operator<(const Time& other) const { return same(other), nanoseconds_ < other.nanoseconds_; }
    bool operator<=(const Time& other) const { return same(other), nanoseconds_ <= other.nanoseconds_; }
    bool operator>(const Time& other) const { return same(other), nanoseconds_ > other.nanoseconds_; }
    bool operator>=(const Time& other) const { return same(other), nanoseconds_ >= other.nanoseconds_; }
    Time operator+(const Duration& span) const { return Time(detail::sum(nanoseconds_, span.nanoseconds()), clock_type_); }
    Time operator-(const Duration& span) const { return Time(detail::sum(nanoseconds_, -span.nanoseconds()), clock_type_); }
    Duration operator-(const Time& other) const {
        if (clock_type_ != other.clock_type_)
            throw std::runtime_error("can't subtract times with different time sources");
        return Duration::from_nanoseconds(nanoseconds_ - other.nanoseconds_);
    }
    Time& operator+=(const Duration& span) { return *this = *this + span; }
    Time& operator-=(const Duration& span) { return *this = *this - span; }

private:
    static std::int64_t checked(std::int64_t value) {
        if (value < 0) throw std::runtime_error("cannot store a negative time point in rclcpp::Time");
        return value;
    }
    void same(const Time& other) const {
        if (clock_type_ != other.clock_type_)
            throw std::runtime_error("can't compare times with different time sources");
    }
    std::int64_t nanoseconds_;
    rcl_clock_type_t clock_type_;
};
inline Time operator+(const Duration& span, const Time& time) { return time + span; }

class Clock {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Clock)
    explicit Clock(rcl_clock_type_t type = RCL_SYSTEM_TIME) : type_(type) {}

    Time now() const { return Time(volery::request("ros.now").integer(), type_); }
    rcl_clock_type_t get_clock_type() const { return type_; }
    bool ros_time_is_active() const { return type_ == RCL_ROS_TIME; }
    bool started() const { return true; }
    bool wait_until_started(Context::SharedPtr = nullptr) const { return true; }
    // Return false if the context was shut down.
    bool sleep_until(Time until, Context::SharedPtr context = nullptr) const {
        if (until.get_clock_type() != type_) throw std::runtime_error("until's clock type does not match this clock's type");
        return sleep_for(until - now(), context);
    }
    bool sleep_for(Duration span, Context::SharedPtr context = nullptr) const {
        if (!ok(context)) return false;
        if (span.nanoseconds() > 0) volery::request("ros.sleep", volery::Writer().put(span.nanoseconds()));
        return ok(context);
    }
    VOLERY_REFUSED("rclcpp::Clock::create_jump_callback is not offered: the clock of a run does not jump")
    std::shared_ptr<void> create_jump_callback(std::function<void()>, std::function<void(const void*)>, int);

private:
    rcl_clock_type_t type_;
};

inline bool sleep_for(const std::chrono::nanoseconds& span, Context::SharedPtr context = nullptr) {
    return Clock().sleep_for(Duration(span), context);
}

class RateBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(RateBase)
    virtual ~RateBase() = default;
    virtual bool sleep() = 0;
    virtual rcl_clock_type_t get_type() const = 0;
    virtual void reset() = 0;
};

// Keeps a loop at a frequency.
class Rate : public RateBase {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(Rate)
    explicit Rate(double frequency, Clock::SharedPtr clock = std::make_shared<Clock>(RCL_SYSTEM_TIME))
        : Rate(Duration::from_seconds(1.0 / positive(frequency)), std::move(clock)) {}
    explicit Rate(const Duration& period, Clock::SharedPtr clock = std::make_shared<Clock>(RCL_SYSTEM_TIME))
        : clock_(std::move(clock)), period_(period) {
        if (period.nanoseconds() <= 0) throw std::invalid_argument("period must be greater than 0");
        Rate::reset();
    }
    // Block until the next release. A loop that is late continues at once.
    bool sleep() override {
        auto const took = volery::request("ros.rate_sleep", volery::Writer().put(number_)).integer();
        return took <= period_.nanoseconds();
    }
    void reset() override { number_ = volery::request("ros.rate", volery::Writer().put(period_.nanoseconds())).integer(); }
    rcl_clock_type_t get_type() const override { return clock_->get_clock_type(); }
    bool is_steady() const { return get_type() == RCL_STEADY_TIME; }
    std::chrono::nanoseconds period() const { return std::chrono::nanoseconds(period_.nanoseconds()); }

private:
    static double positive(double frequency) {
        if (frequency <= 0.0) throw std::invalid_argument("rate must be greater than 0");
        return frequency;
    }
    Clock::SharedPtr clock_;
    Duration period_;
    std::int64_t number_ = 0;
};

class WallRate : public Rate {
public:
    RCLCPP_SMART_PTR_DEFINITIONS(WallRate)
    explicit WallRate(double frequency) : Rate(frequency, std::make_shared<Clock>(RCL_STEADY_TIME)) {}
    explicit WallRate(const Duration& period) : Rate(period, std::make_shared<Clock>(RCL_STEADY_TIME)) {}
};
class ROSRate : public Rate {
public:
    explicit ROSRate(double frequency) : Rate(frequency, std::make_shared<Clock>(RCL_ROS_TIME)) {}
    explicit ROSRate(const Duration& period) : Rate(period, std::make_shared<Clock>(RCL_ROS_TIME)) {}
};
template <class Clock = std::chrono::system_clock>
using GenericRate = Rate;

}  // namespace rclcpp
