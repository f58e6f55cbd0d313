// ros::Rate: keeps a loop at a frequency.
#pragma once
#include "ros/time.h"

namespace ros {

class Rate {
public:
    explicit Rate(double frequency) : Rate(Duration(1.0 / frequency)) {}
    explicit Rate(const Duration& period) : period_(period) { reset(); }

    // Block until the next release. A loop that is late continues at once.
    bool sleep() {
        auto answer = volery::request("ros.rate_sleep", volery::Writer().put(handle_));
        cycle_.fromNSec(answer.integer());
        return cycle_ <= period_;
    }
    // Restart the period now.
    void reset() { handle_ = volery::request("ros.rate", volery::Writer().put(period_.toNSec())).integer(); }
    // Duration of the last cycle, and the period.
    Duration cycleTime() const { return cycle_; }
    Duration expectedCycleTime() const { return period_; }

private:
    Duration period_, cycle_;
    std::int64_t handle_ = 0;
};

class WallRate : public Rate {
public:
    using Rate::Rate;
    explicit WallRate(const WallDuration& period) : Rate(period.toSec() > 0 ? 1.0 / period.toSec() : 0.0) {}
};

inline Duration::Duration(const Rate& rate) { fromNSec(rate.expectedCycleTime().toNSec()); }

}  // namespace ros
