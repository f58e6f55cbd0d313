// ros::CallbackQueue: callbacks that are ready, until they are called.
#pragma once
#include <cstdint>

#include "ros/time.h"

namespace ros {

// What a NodeHandle or options may name. Every queue is a CallbackQueue.
class CallbackQueueInterface {
public:
    virtual ~CallbackQueueInterface() = default;
    // Number of the queue on the graph; the node's own queue has -1.
    virtual std::int64_t number_() = 0;
};

class CallbackQueue : public CallbackQueueInterface {
public:
    enum CallOneResult { Called, TryAgain, Disabled, Empty };

    explicit CallbackQueue(bool enabled = true) : enabled_(enabled) {}
    CallbackQueue(const CallbackQueue&) = delete;
    CallbackQueue& operator=(const CallbackQueue&) = delete;

    // Call one callback, or all that are ready. Without any, wait for one until the time-out.
    CallOneResult callOne(WallDuration timeout = WallDuration()) {
        if (!enabled_) return Disabled;
        return call("ros.queue_call_one", timeout) ? Called : Empty;
    }
    void callAvailable(WallDuration timeout = WallDuration()) {
        if (enabled_) call("ros.queue_call_available", timeout);
    }
    bool isEmpty() { return volery::request("ros.queue_length", volery::Writer().put(number_())).integer() == 0; }
    bool empty() { return isEmpty(); }
    void clear() { volery::request("ros.queue_clear", volery::Writer().put(number_())); }
    void enable() { enabled_ = true; }
    void disable() { enabled_ = false; }
    bool isEnabled() const { return enabled_; }

    std::int64_t number_() override {
        // Not in the constructor: a queue may be a global, which is made before the run.
        if (number == UNKNOWN) number = volery::request("ros.queue").integer();
        return number;
    }

protected:
    static constexpr std::int64_t OWN = -1, UNKNOWN = -2;
    std::int64_t number = UNKNOWN;

private:
    bool call(const char* how, WallDuration timeout) {
        return volery::request(how, volery::Writer().put(number_()).put(timeout.toNSec())).flag();
    }
    bool enabled_;
};

namespace detail {

class OwnQueue : public CallbackQueue {
public:
    OwnQueue() { number = OWN; }
};

inline std::int64_t number_of(CallbackQueueInterface* queue) { return queue != nullptr ? queue->number_() : -1; }

}  // namespace detail

// The queue of the node, which ros::spin() and ros::spinOnce() call.
inline CallbackQueue* getGlobalCallbackQueue() {
    static detail::OwnQueue own;
    return &own;
}

}  // namespace ros
