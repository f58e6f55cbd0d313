// Waiting for a condition that another task of the component fulfils.
#pragma once
#include "ros/init.h"

namespace ros {
namespace detail {

// A task waits until another one says that something has changed.
class Event {
public:
    void notify() {
        ++count_;
        volery::request("ros.event_notify", volery::Writer().put(number()));
    }
    // Wait for a condition; return whether it holds. A time-out of 0 means none. The end of the node ends the wait
    // of those who wait for another node.
    template <class Condition>
    bool wait(Condition condition, const ros::Duration& timeout, bool until_end = true) {
        auto const end = ros::Time::now() + timeout;
        while (true) {
            auto const seen = count_;
            if (condition()) return true;
            auto const left = end - ros::Time::now();
            if ((until_end && !ros::ok()) || (!timeout.isZero() && left <= ros::Duration(0.0))) return false;
            auto const within = timeout.isZero() ? std::int64_t{-1} : left.toNSec();
            volery::request("ros.event_wait", volery::Writer().put(number()).put(seen).put(within).put(until_end));
        }
    }

private:
    std::int64_t number() {
        if (number_ < 0) number_ = volery::request("ros.event").integer();
        return number_;
    }
    std::int64_t number_ = -1, count_ = 0;
};

}  // namespace detail
}  // namespace ros
