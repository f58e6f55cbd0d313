// ros::Timer.
#pragma once
#include <boost/function.hpp>

#include "ros/callback_queue.h"
#include "ros/entity.h"
#include "ros/time.h"

namespace ros {

struct TimerEvent {
    Time last_expected, last_real, current_expected, current_real;
    struct {
        WallDuration last_duration;
    } profile;
};
struct WallTimerEvent {
    WallTime last_expected, last_real, current_expected, current_real;
    struct {
        WallDuration last_duration;
    } profile;
};
using SteadyTimerEvent = WallTimerEvent;
using TimerCallback = boost::function<void(const TimerEvent&)>;
using WallTimerCallback = boost::function<void(const WallTimerEvent&)>;

namespace detail {

// Calls back each period while the node spins. Copies share the timer, which ends with the last copy.
template <class Event, class Time, class Span>
class TimerOf : public Handle {
public:
    using Handle::Handle;
    void start() { request("ros.timer_start"); }
    void stop() { request("ros.timer_stop"); }
    void setPeriod(const Span& period, bool = true) {
        if (entity_) volery::request("ros.timer_period", volery::Writer().put(entity_->handle()).put(period.toNSec()));
    }
    bool hasStarted() const { return count("ros.timer_started") != 0; }
    bool hasPending() const { return hasStarted(); }
    bool isValid() const { return entity_ != nullptr; }

    static TimerOf make(Span period, boost::function<void(const Event&)> callback, bool oneshot, bool autostart,
                        std::int64_t queue) {
        auto const callable = volery::register_callable([callback](volery::Reader in, volery::Writer&) {
            Event event;
            event.last_expected = Time().fromNSec(static_cast<std::uint64_t>(in.integer()));
            event.last_real = Time().fromNSec(static_cast<std::uint64_t>(in.integer()));
            event.current_expected = Time().fromNSec(static_cast<std::uint64_t>(in.integer()));
            event.current_real = Time().fromNSec(static_cast<std::uint64_t>(in.integer()));
            event.profile.last_duration.fromNSec(in.integer());
            callback(event);
        });
        auto const with = volery::Writer().put(period.toNSec()).put(oneshot).put(autostart).put(callable).put(queue);
        return TimerOf(std::make_shared<Entity>(volery::request("ros.timer", with).integer(), "", callable));
    }
};

}  // namespace detail

using Timer = detail::TimerOf<TimerEvent, Time, Duration>;
using WallTimer = detail::TimerOf<WallTimerEvent, WallTime, WallDuration>;
using SteadyTimer = WallTimer;

struct TimerOptions {
    TimerOptions() = default;
    TimerOptions(Duration period, const TimerCallback& callback, CallbackQueueInterface* queue, bool oneshot = false,
                 bool autostart = true)
        : period(period), callback(callback), callback_queue(queue), oneshot(oneshot), autostart(autostart) {}

    Duration period;
    TimerCallback callback;
    CallbackQueueInterface* callback_queue = nullptr;
    bool oneshot = false;
    bool autostart = true;
};

}  // namespace ros
