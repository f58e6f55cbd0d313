// ros::Time, ros::Duration and their wall-clock variants, which also use the clock of the run.
#pragma once
#include <math.h>  // user code relies on its names without std::

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <iostream>  // as in roscpp: files use std::cout without it
#include <limits>
#include <stdexcept>

#include "volery/abi.h"

namespace ros {

class Exception : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

namespace detail {

constexpr std::int64_t SECOND = 1000000000;

inline std::int64_t nanoseconds(double seconds) {
    double const whole = std::floor(seconds);
    return static_cast<std::int64_t>(whole) * SECOND + std::llround((seconds - whole) * 1e9);
}

// Times are from 0 to 2^32 s. Before the start of the clock there is none, and roscpp throws.
inline std::uint64_t checked_time(std::int64_t total) {
    if (total < 0 || total / SECOND > std::numeric_limits<std::uint32_t>::max())
        throw std::runtime_error("Time is out of dual 32-bit range");
    return static_cast<std::uint64_t>(total);
}

}  // namespace detail

// Base class of durations; Self is the derived class.
template <class Self>
class DurationBase {
public:
    std::int32_t sec = 0;
    std::int32_t nsec = 0;

    DurationBase() = default;
    DurationBase(std::int32_t seconds, std::int32_t nanoseconds) {
        fromNSec(seconds * detail::SECOND + nanoseconds);
    }
    explicit DurationBase(double seconds) { fromSec(seconds); }

    double toSec() const { return sec + 1e-9 * nsec; }
    std::int64_t toNSec() const { return sec * detail::SECOND + nsec; }
    Self& fromSec(double seconds) { return fromNSec(detail::nanoseconds(seconds)); }
    Self& fromNSec(std::int64_t total) {
        nsec = static_cast<std::int32_t>(((total % detail::SECOND) + detail::SECOND) % detail::SECOND);
        sec = static_cast<std::int32_t>((total - nsec) / detail::SECOND);
        return static_cast<Self&>(*this);
    }
    bool isZero() const { return sec == 0 && nsec == 0; }
    bool sleep() const {
        volery::request("ros.sleep", volery::Writer().put(toNSec()));
        return true;
    }

    Self operator+(const Self& other) const { return Self().fromNSec(toNSec() + other.toNSec()); }
    Self operator-(const Self& other) const { return Self().fromNSec(toNSec() - other.toNSec()); }
    Self operator-() const { return Self().fromNSec(-toNSec()); }
    Self operator*(double factor) const { return Self().fromSec(toSec() * factor); }
    Self& operator+=(const Self& other) { return fromNSec(toNSec() + other.toNSec()); }
    Self& operator-=(const Self& other) { return fromNSec(toNSec() - other.toNSec()); }
    Self& operator*=(double factor) { return fromSec(toSec() * factor); }
    template <class Visitor, class Span>
    static void each_(Visitor& visit, Span& span) {
        visit("sec", span.sec);
        visit("nsec", span.nsec);
    }
    bool operator==(const Self& other) const { return toNSec() == other.toNSec(); }
    bool operator!=(const Self& other) const { return toNSec() != other.toNSec(); }
    bool operator<(const Self& other) const { return toNSec() < other.toNSec(); }
    bool operator>(const Self& other) const { return toNSec() > other.toNSec(); }
    bool operator<=(const Self& other) const { return toNSec() <= other.toNSec(); }
    bool operator>=(const Self& other) const { return toNSec() >= other.toNSec(); }
};

class Rate;

class Duration : public DurationBase<Duration> {
public:
    using DurationBase::DurationBase;
    Duration() = default;
    explicit Duration(const Rate& rate);
};

class WallDuration : public DurationBase<WallDuration> {
public:
    using DurationBase::DurationBase;
    WallDuration() = default;
};

// Base class of points in time; Span is the type of their difference.
template <class Self, class Span>
class TimeBase {
public:
    std::uint32_t sec = 0;
    std::uint32_t nsec = 0;

    TimeBase() = default;
    TimeBase(std::uint32_t seconds, std::uint32_t nanoseconds)
        : sec(seconds + nanoseconds / detail::SECOND), nsec(nanoseconds % detail::SECOND) {}
    explicit TimeBase(double seconds) { fromSec(seconds); }

    static Self now() { return Self().fromNSec(static_cast<std::uint64_t>(volery::request("ros.now").integer())); }
    static bool sleepUntil(const Self& end) {
        Span const left = end - now();
        return left > Span() ? left.sleep() : true;
    }

    double toSec() const { return sec + 1e-9 * nsec; }
    std::uint64_t toNSec() const { return sec * static_cast<std::uint64_t>(detail::SECOND) + nsec; }
    Self& fromSec(double seconds) { return fromNSec(detail::checked_time(detail::nanoseconds(seconds))); }
    Self& fromNSec(std::uint64_t total) {
        sec = static_cast<std::uint32_t>(total / detail::SECOND);
        nsec = static_cast<std::uint32_t>(total % detail::SECOND);
        return static_cast<Self&>(*this);
    }
    bool isZero() const { return sec == 0 && nsec == 0; }
    bool is_zero() const { return isZero(); }

    Span operator-(const Self& other) const {
        return Span().fromNSec(static_cast<std::int64_t>(toNSec() - other.toNSec()));
    }
    Self operator+(const Span& span) const { return Self().fromNSec(moved(span.toNSec())); }
    Self operator-(const Span& span) const { return Self().fromNSec(moved(-span.toNSec())); }
    Self& operator+=(const Span& span) { return fromNSec(moved(span.toNSec())); }
    Self& operator-=(const Span& span) { return fromNSec(moved(-span.toNSec())); }
    template <class Visitor, class Moment>
    static void each_(Visitor& visit, Moment& time) {
        visit("sec", time.sec);
        visit("nsec", time.nsec);
    }
    bool operator==(const Self& other) const { return toNSec() == other.toNSec(); }
    bool operator!=(const Self& other) const { return toNSec() != other.toNSec(); }
    bool operator<(const Self& other) const { return toNSec() < other.toNSec(); }
    bool operator>(const Self& other) const { return toNSec() > other.toNSec(); }
    bool operator<=(const Self& other) const { return toNSec() <= other.toNSec(); }
    bool operator>=(const Self& other) const { return toNSec() >= other.toNSec(); }

private:
    std::uint64_t moved(std::int64_t by) const { return detail::checked_time(static_cast<std::int64_t>(toNSec()) + by); }
};

class Time : public TimeBase<Time, Duration> {
public:
    using TimeBase::TimeBase;
    Time() = default;
    static void init() {}
    static void shutdown() {}
    static bool isValid() { return true; }
    static bool waitForValid() { return true; }
    static bool isSystemTime() { return false; }
    static bool isSimTime() { return true; }
};

class WallTime : public TimeBase<WallTime, WallDuration> {
public:
    using TimeBase::TimeBase;
    WallTime() = default;
};
using SteadyTime = WallTime;

const Time TIME_MIN(0, 1);
const Time TIME_MAX(std::numeric_limits<std::uint32_t>::max(), 999999999);
const Duration DURATION_MIN(std::numeric_limits<std::int32_t>::min(), 0);
const Duration DURATION_MAX(std::numeric_limits<std::int32_t>::max(), 999999999);

template <class Self, class Span>
std::ostream& operator<<(std::ostream& out, const TimeBase<Self, Span>& time) {
    char text[32];
    std::snprintf(text, sizeof text, "%u.%09u", time.sec, time.nsec);
    return out << text;
}

template <class Self>
std::ostream& operator<<(std::ostream& out, const DurationBase<Self>& span) {
    char text[32];
    std::snprintf(text, sizeof text, "%.9f", span.toSec());
    return out << text;
}

}  // namespace ros
